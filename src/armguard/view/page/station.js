// The station's own part of the page. What it shows and sounds comes on its own channel;
// what keys and gamepads say goes back on it. Nothing here judges anything.
"use strict";
(() => {
  const REPEAT = 50; // keys that are held and gamepads are sent again after this [ms]
  const ANSWER = 4000; // a question waits so long for its answer [ms]
  const READING = 0.5; // an open explanation is left as it is for so long [s]
  const PULSE = 100; // that this page lives is sent again after this [ms]
  const ADOPT = 300; // new parts of viser's page are looked for after this [ms]
  const make = (tag, id, parent) => {
    const made = document.createElement(tag);
    if (id) made.id = id;
    parent?.append(made);
    return made;
  };

  // ------------------------------------------------------------------- display
  const bar = make("div", "station");
  const light = make("div", "light", bar);
  light.setAttribute("role", "status");
  const word = make("span", null, light);
  word.textContent = "WAITING";
  const words = make("div", "words", bar);
  const why = make("div", "why", words);
  const headroom = make("div", "headroom", words);
  const role = make("div", "role", words);
  const recorder = make("div", "recorder", words);
  const robots = make("div", "robots", bar);
  const tools = make("div", "tools", bar);
  const sound = make("button", "sound", tools);
  sound.textContent = "Sound: off";
  const drive = make("button", "drive", tools);
  drive.hidden = true;
  const engage = make("button", "engage", bar);
  engage.textContent = "Engage all";
  engage.hidden = true;
  const stop = make("button", "stop", bar);
  stop.textContent = "STOP";
  stop.title = "stops all arms (space)";
  const veil = make("div", "veil");
  const busy = make("div", "busy");
  const refused = make("div", "refused");
  const refusal = make("span", null, refused);
  const remedy = make("button", null, refused);
  const fold = make("details", "exactly");
  make("summary", null, fold).textContent = "Why exactly";
  const exactly = make("pre", null, fold);
  const cards = new Map();

  const card = (name) => {
    if (cards.has(name)) return cards.get(name);
    const box = make("div", null, robots);
    box.className = "robot";
    box.dataset.name = name;
    box.tabIndex = 0;
    const head = make("b", null, box);
    const title = make("span", null, head);
    title.textContent = name;
    const action = make("span", null, head);
    const words = make("small", null, box);
    const gauge = make("div", null, box);
    gauge.className = "urgency";
    const fill = make("i", null, gauge);
    cards.set(name, { box, action, words, fill });
    placed();
    return cards.get(name);
  };

  let state = null; // the newest message
  let may = null; // what this page may do
  let asked = null; // the timer of a question that waits for its answer
  const showButtons = () => {
    const commands = !state?.recorded && may?.engage;
    engage.hidden = !(state?.held && commands);
    engage.title = may?.taken ? "takes the command for that from the client that has it" : "";
    drive.hidden = !commands || may.commands;
    if (!asked) drive.textContent = "Drive yourself";
    sound.hidden = stop.hidden = Boolean(state?.recorded);
  };
  let heard = 0; // when it came, on this page's clock [s]
  const now = () => performance.now() / 1000;

  let explained = -Infinity; // when the open fold was written, on this page's clock [s]
  const explain = (message) => {
    explained = now();
    exactly.textContent = `cycle ${message.cycle}\n${message.explanation}`;
  };
  fold.addEventListener("toggle", () => {
    if (fold.open && state) explain(state);
  });

  const show = (message) => {
    state = message;
    heard = now();
    light.dataset.level = message.name;
    word.textContent = message.word;
    document.documentElement.style.setProperty("--level", message.colour);
    document.documentElement.style.setProperty("--ink", message.ink);
    why.textContent = message.why;
    if (fold.open && now() - explained > READING) explain(message);
    showButtons();
    if (message.recorded) timeLine.show(message);
    if (message.places) charts.show(message.places);
    for (const robot of message.robots) {
      const own = card(robot.name);
      own.box.style.setProperty("--own", robot.colour);
      own.box.title = robot.blocked;
      own.action.textContent = robot.word;
      own.words.textContent = robot.blocked;
      own.fill.style.width = `${Math.round(100 * robot.urgency)}%`;
    }
  };

  // Viser makes these parts when it likes: the plot gets the focus of the keyboard, and
  // the picture ends where the panel of a phone begins.
  const adopt = () => {
    for (const plot of document.querySelectorAll(".uplot:not([tabindex])")) plot.tabIndex = 0;
    const panel = document.querySelector('#root .mantine-Paper-root[style*="position: fixed"]');
    const height = `${panel?.offsetHeight ?? 0}px`;
    const root = document.documentElement.style;
    if (root.getPropertyValue("--sheet") !== height) root.setProperty("--sheet", height);
  };

  const refresh = () => {
    if (state === null) return;
    const age = state.age + now() - heard;
    const written = state.recorded ? state.recorded : `written ${(1000 * age).toFixed(0)} ms ago`;
    headroom.textContent = [...state.measures, `cycle ${state.cycle}`, written].join(" · ");
  };

  // ------------------------------------------------------- what does not wait for us
  // The light, the sounds and the channel have separate threads, see cues.js; this
  // one is kept busy by the drawing.
  const cues = new Worker(`cues.js?page=${window.stationPage}`);
  const over = make("canvas", "drawn", bar);
  const within = (part) => {
    const [inner, outer] = [part.getBoundingClientRect(), bar.getBoundingClientRect()];
    return { x: inner.x - outer.x, y: inner.y - outer.y, width: inner.width, height: inner.height };
  };
  const placed = () => cues.postMessage({
    type: "layout",
    scale: window.devicePixelRatio || 1,
    width: bar.offsetWidth,
    height: bar.offsetHeight,
    light: within(light),
    words: within(words),
    cards: [...cards.values()].map(({ box }) => within(box)),
  });
  if (over.transferControlToOffscreen) {
    const canvas = over.transferControlToOffscreen();
    cues.postMessage({ type: "canvas", canvas }, [canvas]);
    // The words beneath are for those who have them read out.
    bar.classList.add("drawn");
    const sizes = new ResizeObserver(placed);
    for (const part of [bar, light, words, robots]) sizes.observe(part);
  }
  window.stationTurns = []; // the last turns of the light: cycle and wall clock [s]
  window.stationBeeps = []; // the last beeps, for those who check them
  const note = (list, what) => { list.push(what); list.splice(0, list.length - 500); };

  let audio = null;
  let muted = true;
  const hear = async () => {
    const made = new AudioContext();
    await made.audioWorklet.addModule("beeps.js");
    const node = new AudioWorkletNode(made, "beeps", { numberOfInputs: 0 });
    node.port.onmessage = ({ data }) => note(window.stationBeeps, data);
    node.connect(made.destination);
    audio = made;
    const { port1, port2 } = new MessageChannel();
    node.port.postMessage({ pipe: port1 }, [port1]);
    cues.postMessage({ type: "pipe", pipe: port2 }, [port2]);
  };
  sound.onclick = async () => {
    if (audio === null) await hear();
    if (muted) await audio.resume();
    muted = !muted;
    cues.postMessage({ type: "muted", muted });
    sound.textContent = muted ? "Sound: off" : "Sound: on";
    sound.setAttribute("aria-pressed", String(!muted));
    sound.blur();
  };

  // ------------------------------------------------------------------- messages
  const say = (message) => cues.postMessage({ type: "say", message });
  engage.onclick = () => { say({ type: "engage" }); engage.blur(); };
  stop.onclick = () => { say({ type: "stop" }); stop.blur(); };
  drive.onclick = () => {
    drive.blur();
    if (may?.taken && asked === null) {
      // Another client loses the command by it: the second click is the answer.
      drive.textContent = "Take over?";
      asked = setTimeout(() => { asked = null; showButtons(); }, ANSWER);
      return;
    }
    clearTimeout(asked);
    asked = null;
    say({ type: "drive" });
  };
  remedy.onclick = () => { remedy.blur(); say({ type: "drive" }); };
  const timeLine = makeTimeLine(say);
  const line = makeLine();
  const charts = makeCharts(say);

  let driving = false; // whether the view wants keys at all
  const held = new Set();
  const typing = (event) => event.target?.closest?.(
    "input:not([type=checkbox]):not([type=radio]):not([type=range]), textarea, [contenteditable=true]");
  const tellKeys = () => say({ type: "keys", held: [...held] });
  const letGo = () => { if (held.size) { held.clear(); tellKeys(); } };
  window.addEventListener("keydown", (event) => {
    if (event.code === "Space" && !typing(event)) {
      event.preventDefault();
      event.stopImmediatePropagation();
      if (!event.repeat) say({ type: state?.recorded ? "play" : "stop" });
      return;
    }
    if (!driving || typing(event) || event.ctrlKey || event.metaKey || event.altKey) return;
    if (!/^(Key[A-Z]|Digit[1-9]|Arrow\w+)$/.test(event.code)) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    if (!held.has(event.code)) { held.add(event.code); tellKeys(); }
  }, true);
  window.addEventListener("keyup", (event) => {
    if (held.delete(event.code)) { event.stopImmediatePropagation(); tellKeys(); }
  }, true);
  window.addEventListener("blur", letGo);
  document.addEventListener("visibilitychange", () => { if (document.hidden) letGo(); });

  let padSaid = false;
  const tellPads = () => {
    if (held.size) tellKeys();
    const pad = driving ? [...navigator.getGamepads()].find((one) => one?.connected) : null;
    if (pad) {
      say({ type: "pad", axes: [...pad.axes], buttons: pad.buttons.map((one) => one.value) });
      padSaid = true;
    } else if (padSaid) {
      say({ type: "pad", axes: [], buttons: [] });
      padSaid = false;
    }
  };

  // A page that is stuck says nothing here, whatever its other threads do: what it asked
  // for ends then.
  const down = new Set(); // pointers that are held down
  const pulse = () => { if (!document.hidden) say({ type: "pulse", held: down.size > 0 }); };
  window.addEventListener("pointerdown", (event) => { down.add(event.pointerId); pulse(); }, true);
  for (const kind of ["pointerup", "pointercancel"]) {
    window.addEventListener(kind, (event) => { if (down.delete(event.pointerId)) pulse(); }, true);
  }
  // A release can go unheard, such as one beside a menu of the browser.
  window.addEventListener("pointermove", (event) => {
    if (event.buttons === 0 && down.delete(event.pointerId)) pulse();
  }, true);
  window.addEventListener("blur", () => { down.clear(); pulse(); });

  // The pair that the pointer or the focus of the keyboard is on is marked in the picture.
  let beneath = null; // what the pointer is over
  let pointed = ""; // what the view was sent
  const pairOf = (part) => {
    const card = part?.closest?.(".robot");
    if (card) return { at: "robot", name: card.dataset.name };
    if (part?.closest?.(".uplot")) return { at: "plot", name: "" };
    const row = part?.closest?.("#root tbody tr");
    return row ? { at: "pair", name: row.cells[0].textContent } : null;
  };
  const point = () => {
    const focused = document.querySelector(".robot:focus-visible, .uplot:focus-visible");
    const found = pairOf(beneath) ?? pairOf(focused) ?? { at: "", name: "" };
    if (JSON.stringify(found) === pointed) return;
    pointed = JSON.stringify(found);
    say({ type: "mark", ...found });
  };
  window.addEventListener("pointerover", (event) => { beneath = event.target; point(); }, true);
  document.documentElement.addEventListener("pointerleave", () => { beneath = null; point(); });
  for (const kind of ["focusin", "focusout"]) window.addEventListener(kind, () => setTimeout(point), true);

  cues.onmessage = ({ data }) => {
    if (data.type === "state") {
      cues.postMessage({ type: "seen" });
      show(data);
    } else if (data.type === "may") {
      may = data;
      role.textContent = may.engage ? "" : `this page may ${may.role}, and stop`;
      showButtons();
    } else if (data.type === "timeline") {
      document.body.append(timeLine.box);
      document.documentElement.classList.add("recording");
      timeLine.begin(data);
    } else if (data.type === "veil") {
      veil.textContent = data.said;
      document.documentElement.classList.toggle("grey", data.said !== "");
    } else if (data.type === "line") line.show(data);
    else if (data.type === "charts") charts.begin(data);
    else if (data.type === "busy") busy.textContent = data.said;
    else if (data.type === "refused") {
      refusal.textContent = data.said;
      [remedy.textContent, remedy.hidden] = [data.remedy, !data.remedy];
      refused.hidden = !data.said;
    } else if (data.type === "recorder") recorder.textContent = data.said;
    else if (data.type === "turned") note(window.stationTurns, [data.cycle, data.at]);
    else if (data.type === "driving") {
      driving = data.on;
      bar.dataset.driving = String(driving);
      letGo();
    }
  };

  const begin = () => {
    document.body.prepend(bar);
    document.body.append(veil, busy, refused, fold, line.box, charts.box);
    refused.hidden = true;
    setInterval(refresh, 50);
    setInterval(tellPads, REPEAT);
    setInterval(adopt, ADOPT);
    setInterval(pulse, PULSE);
  };
  if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", begin);
  else begin();
})();
