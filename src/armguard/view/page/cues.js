// The header, and when there is a beep: what must not wait for the drawing. A scene that
// is drawn without a graphics card keeps the page's own thread for seconds; this is a
// thread beside it, with the channel to the view, a canvas and a pipe to the sound.
"use strict";
importScripts("header.js");
const SILENCE = 500; // without news for so long the light is grey [ms]
const AGAIN = 500; // from a channel that closed to the next try [ms]
const LOOK = 25; // how often it is looked whether a beep is due [ms]
const PITCHES = [523, 349, 659, 440]; // a robot's own tone [Hz]

let pen = null; // draws the header
let layout = null; // where its parts are [px]
const notes = { recorder: "", may: "" }; // what the view adds to the sentence
let pipe = null; // leads to what makes sound
let muted = true;
let channel = null;
let state = null; // the newest message
let heard = -Infinity; // when it came [ms]
let shown = ""; // what the header shows
let unseen = 0; // messages the page has not looked at yet
let late = null; // the newest of those it was not sent meanwhile

const isGrey = () => veil() !== "";

const line = () => {
  const age = state.age + (performance.now() - heard) / 1000;
  const when = state.recorded || (age < 0.2 ? "live" : `written ${age.toFixed(1)} s ago`);
  return [...state.measures, `cycle ${state.cycle}`, when].join(" · ");
};

const draw = () => {
  if (pen === null || layout === null || state === null) return;
  const grey = isGrey();
  const beside = { line: line(), notes: Object.values(notes).filter(Boolean) };
  const now = JSON.stringify([state.cycle, state.word, state.why, state.robots, beside, grey]);
  if (now === shown) return;
  shown = now;
  drawHeader(pen, layout, state, beside, grey);
};

// Why the page is grey, in words; "" where it is the present. This thread knows: the page's
// own one may have been busy with the drawing, and not the view silent.
const veil = () => {
  if (state === null) return "waiting for the view";
  const silent = performance.now() - heard;
  if (silent <= SILENCE) return state.grey;
  const words = `the view has been silent for ${(silent / 1000).toFixed(1)} s`;
  return state.recorded ? words : `${words}. STOP may not arrive: use the emergency stop`;
};
let veiled = null; // what the page was sent of it
const cover = () => {
  const said = veil();
  if (said !== veiled) postMessage({ type: "veil", said });
  veiled = said;
};

const due = new Map(); // when a robot's next beep is [ms]
// From one beep in a second to eight: the more urgent, the faster.
const pause = (urgency) => 1000 / (1 + 7 * urgency);
const sound = (changed) => {
  if (muted || pipe === null || isGrey() || state.recorded) return;
  const now = performance.now();
  state.robots.forEach((robot, k) => {
    if (robot.urgency <= 0 && robot.level < 20) return due.delete(robot.name);
    if (changed || now >= (due.get(robot.name) ?? 0)) {
      const hertz = PITCHES[k % PITCHES.length];
      const { name, level } = robot;
      pipe.postMessage({ name, hertz, level, cycle: changed ? state.cycle : null });
      due.set(robot.name, now + pause(robot.urgency));
    }
  });
};

const hand = (message) => {
  unseen += 1;
  postMessage(message);
};

const take = (message) => {
  const before = state;
  state = message;
  heard = performance.now();
  const levels = (one) => [one.level, one.name, one.changed, ...one.robots.map((robot) => robot.level)].join();
  const changed = before === null || levels(before) !== levels(message);
  draw();
  cover();
  sound(changed);
  if (before === null || before.level !== message.level) {
    postMessage({ type: "turned", cycle: message.cycle, at: Date.now() / 1000 });
  }
  // A page that is busy gets every change, and of the rest the newest.
  if (changed || unseen === 0) {
    late = null;
    hand(message);
  } else late = message;
};

const connect = () => {
  channel = new WebSocket(`ws://${location.host}/station${location.search}`);
  channel.onmessage = (event) => {
    const message = JSON.parse(event.data);
    if (message.type === "state") return take(message);
    if (message.type === "recorder") notes.recorder = message.said;
    if (message.type === "may") {
      notes.may = message.engage ? "" : `this page may ${message.role}, and stop`;
    }
    postMessage(message);
  };
  channel.onclose = () => setTimeout(connect, AGAIN);
};

onmessage = ({ data }) => {
  if (data.type === "canvas") {
    pen = data.canvas.getContext("2d");
  } else if (data.type === "layout" && pen !== null) {
    layout = data;
    const { scale, width, height } = data;
    [pen.canvas.width, pen.canvas.height] = [width * scale, height * scale];
    shown = "";
    draw();
  } else if (data.type === "pipe") pipe = data.pipe;
  else if (data.type === "muted") muted = data.muted;
  else if (data.type === "say") {
    if (channel?.readyState === WebSocket.OPEN) channel.send(JSON.stringify(data.message));
  } else if (data.type === "seen") {
    unseen = Math.max(unseen - 1, 0);
    if (unseen === 0 && late !== null) {
      hand(late);
      late = null;
    }
  }
};

connect();
setInterval(() => { draw(); cover(); sound(false); }, LOOK);
