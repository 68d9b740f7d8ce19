// The station's own part of the page. What it shows and sounds comes on its own channel;
// what keys and gamepads say goes back on it. Nothing here judges anything.
"use strict";
(() => {
  const SILENCE = 0.5; // without news for so long the page is grey [s]
  const REPEAT = 50; // keys that are held and gamepads are told again after this [ms]
  const PITCHES = [523, 349, 659, 440]; // a robot's own tone [Hz]
  const make = (tag, id, parent) => {
    const made = document.createElement(tag);
    if (id) made.id = id;
    parent?.append(made);
    return made;
  };

  // ------------------------------------------------------------------- what is seen
  const bar = make("div", "station");
  const light = make("div", "light", bar);
  light.setAttribute("role", "status");
  light.textContent = "WAITING";
  const told = make("div", "told", bar);
  const why = make("div", "why", told);
  const slack = make("div", "slack", told);
  const robots = make("div", "robots", bar);
  const sound = make("button", "sound", bar);
  sound.textContent = "Sound: off";
  const stop = make("button", "stop", bar);
  stop.textContent = "STOP";
  stop.title = "stops all arms (space)";
  const veil = make("div", "veil");
  const cards = new Map();

  const card = (name) => {
    if (cards.has(name)) return cards.get(name);
    const box = make("div", null, robots);
    box.className = "robot";
    const head = make("b", null, box);
    const title = make("span", null, head);
    title.textContent = name;
    const action = make("span", null, head);
    const words = make("small", null, box);
    const gauge = make("div", null, box);
    gauge.className = "urgency";
    const fill = make("i", null, gauge);
    cards.set(name, { box, action, words, fill });
    return cards.get(name);
  };

  let state = null; // the newest message
  let heard = -Infinity; // when it came, on this page's clock [s]
  const now = () => performance.now() / 1000;

  const number = (value, digits, unit) =>
    value === null ? "–" : `${value.toFixed(digits)} ${unit}`;

  const show = (message) => {
    if (state === null || state.level !== message.level) {
      // Whoever measures how fast the light is reads both of these.
      light.dataset.cycle = message.cycle;
      light.dataset.turned = Date.now() / 1000;
    }
    state = message;
    heard = now();
    light.dataset.level = message.name;
    light.textContent = message.word;
    light.classList.toggle("urgent", message.level >= 30);
    document.documentElement.style.setProperty("--level", message.colour);
    document.documentElement.style.setProperty("--ink", message.ink);
    why.textContent = message.remark ? `${message.remark} (${message.why})` : message.why;
    for (const robot of message.robots) {
      const own = card(robot.name);
      own.box.style.setProperty("--own", robot.colour);
      own.box.title = robot.blocked;
      own.action.textContent = robot.word;
      own.words.textContent = robot.blocked;
      own.fill.style.width = `${Math.round(100 * robot.urgency)}%`;
    }
  };

  const refresh = () => {
    const silent = now() - heard;
    const age = state === null ? Infinity : state.age + silent;
    const grey = state === null || silent > SILENCE || state.grey !== "";
    document.body?.classList.toggle("grey", grey);
    if (state === null) veil.textContent = "waiting for the view";
    else if (silent > SILENCE) veil.textContent = `the view is silent since ${silent.toFixed(1)} s`;
    else veil.textContent = state.grey;
    if (state !== null) {
      const written = state.recorded ? state.recorded : `written ${(1000 * age).toFixed(0)} ms ago`;
      slack.textContent =
        `slack ${number(state.slack_ms, 0, "ms")} · ${number(state.slack_mm, 1, "mm")}` +
        ` · cycle ${state.cycle} · ${written}`;
    }
  };

  // ------------------------------------------------------------------- what is heard
  let audio = null;
  let muted = true;
  const due = new Map(); // when a robot's next beep is [s of the audio clock]
  window.stationBeeps = []; // the last beeps, for those who check them
  const beep = (k, robot) => {
    const start = audio.currentTime;
    const tone = audio.createOscillator();
    const gain = audio.createGain();
    tone.type = robot.level >= 30 ? "square" : "sine";
    tone.frequency.value = PITCHES[k % PITCHES.length];
    gain.gain.setValueAtTime(0.0001, start);
    gain.gain.exponentialRampToValueAtTime(0.25, start + 0.01);
    gain.gain.exponentialRampToValueAtTime(0.0001, start + 0.09);
    tone.connect(gain).connect(audio.destination);
    tone.start(start);
    tone.stop(start + 0.1);
    window.stationBeeps.push({ name: robot.name, hertz: tone.frequency.value, level: robot.level, at: Date.now() / 1000 });
    window.stationBeeps.splice(0, window.stationBeeps.length - 50);
  };
  // From one beep in a second to eight: the more urgent, the faster.
  const pause = (urgency) => 1 / (1 + 7 * urgency);
  const listen = (changed) => {
    if (muted || audio === null || state === null || state.grey !== "" || state.recorded) return;
    state.robots.forEach((robot, k) => {
      if (robot.urgency <= 0 && robot.level < 20) return due.delete(robot.name);
      if (changed || audio.currentTime >= (due.get(robot.name) ?? 0)) {
        beep(k, robot);
        due.set(robot.name, audio.currentTime + pause(robot.urgency));
      }
    });
  };
  sound.onclick = async () => {
    muted = !muted;
    audio ??= new AudioContext();
    if (!muted) await audio.resume();
    sound.textContent = muted ? "Sound: off" : "Sound: on";
    sound.setAttribute("aria-pressed", String(!muted));
    sound.blur();
  };

  // ------------------------------------------------------------------- what is said
  let channel = null;
  const say = (message) => {
    if (channel?.readyState === WebSocket.OPEN) channel.send(JSON.stringify(message));
  };
  stop.onclick = () => { say({ type: "stop" }); stop.blur(); };

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
      if (!event.repeat) say({ type: "stop" });
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

  const connect = () => {
    channel = new WebSocket(`ws://${location.host}/station`);
    channel.onmessage = (event) => {
      const message = JSON.parse(event.data);
      if (message.type === "state") {
        const changed = state === null || state.robots.some((one, k) => one.level !== message.robots[k]?.level);
        show(message);
        listen(changed);
      } else if (message.type === "driving") {
        driving = message.on;
        bar.dataset.driving = String(driving);
        letGo();
      }
    };
    channel.onclose = () => setTimeout(connect, 500);
  };

  const begin = () => {
    document.body.prepend(bar);
    document.body.append(veil);
    connect();
    setInterval(refresh, 50);
    setInterval(() => listen(false), 25);
    setInterval(tellPads, REPEAT);
  };
  if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", begin);
  else begin();
})();
