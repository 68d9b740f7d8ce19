// The light, and when there is a beep: what must not wait for the drawing. A scene that
// is drawn without a graphics card keeps the page's own thread for seconds; this is a
// thread beside it, with the channel to the view, a canvas and a pipe to the sound.
"use strict";
const SILENCE = 500; // without news for so long the light is grey [ms]
const AGAIN = 500; // from a channel that closed to the next try [ms]
const LOOK = 25; // how often it is looked whether a beep is due [ms]
const PITCHES = [523, 349, 659, 440]; // a robot's own tone [Hz]
const ROOM = 0.86; // share of its width a word may take
const GREY = { colour: "#9aa0a6", ink: "#000000" };

let pen = null; // draws the light
let pipe = null; // leads to what makes sound
let muted = true;
let channel = null;
let state = null; // the newest message
let heard = -Infinity; // when it came [ms]
let shown = ""; // what the light shows
let unseen = 0; // messages the page has not looked at yet
let late = null; // the newest of those it was not sent meanwhile

const isGrey = () =>
  state === null || state.grey !== "" || performance.now() - heard > SILENCE;

const light = () => {
  if (pen === null || state === null) return;
  const { colour, ink } = isGrey() ? GREY : state;
  const { width, height } = pen.canvas;
  const urgent = state.level >= 30;
  const now = [state.word, colour, urgent, width, height].join();
  if (now === shown) return;
  shown = now;
  pen.fillStyle = colour;
  pen.fillRect(0, 0, width, height);
  pen.fillStyle = pen.strokeStyle = ink;
  const write = (size) => {
    pen.font = `800 ${size}px system-ui, "Segoe UI", "DejaVu Sans", sans-serif`;
  };
  // As large as the height allows, and no wider than the light.
  const size = 0.42 * height;
  write(size);
  const wide = pen.measureText(state.word).width;
  if (wide > ROOM * width) write((size * ROOM * width) / wide);
  pen.textAlign = "center";
  pen.textBaseline = "middle";
  pen.fillText(state.word, width / 2, height / 2);
  if (urgent) {
    pen.lineWidth = 0.12 * height;
    pen.strokeRect(0, 0, width, height);
  }
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
  light();
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
    if (message.type === "state") take(message);
    else postMessage(message);
  };
  channel.onclose = () => setTimeout(connect, AGAIN);
};

onmessage = ({ data }) => {
  if (data.type === "canvas") {
    pen = data.canvas.getContext("2d");
    light();
  } else if (data.type === "size" && pen !== null) {
    [pen.canvas.width, pen.canvas.height] = [data.width, data.height];
    shown = "";
    light();
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
setInterval(() => { light(); sound(false); }, LOOK);
