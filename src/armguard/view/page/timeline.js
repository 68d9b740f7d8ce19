// The time line of a recording, across the page below the picture: states as colours,
// stops as marks. A click or a drag goes there; the buttons play, step and jump.
"use strict";
const makeTimeLine = (say) => {
  const make = (tag, id, parent) => {
    const made = document.createElement(tag);
    made.id = id;
    parent?.append(made);
    return made;
  };
  const box = make("div", "timeline");
  const buttons = make("div", "playback", box);
  const track = make("div", "track", box);
  const levels = make("canvas", "levels", track);
  const cursor = make("div", "cursor", track);
  const at = make("div", "at", box);
  let line = null; // length, states and stops of the recording

  const button = (id, text, title, message) => {
    const made = make("button", id, buttons);
    [made.textContent, made.title] = [text, title];
    made.onclick = () => { say(message()); made.blur(); };
    return made;
  };
  button("before", "|◀", "the stop before", () => ({ type: "seek", stop: -1 }));
  button("back", "−1", "one cycle back", () => ({ type: "seek", cycles: -1 }));
  const play = button("play", "Play", "play or pause", () => ({ type: "play" }));
  button("forth", "+1", "one cycle on", () => ({ type: "seek", cycles: 1 }));
  button("next", "▶|", "the next stop", () => ({ type: "seek", stop: 1 }));
  const speed = make("select", "speed", buttons);
  speed.title = "speed";
  speed.onchange = () => { say({ type: "speed", value: Number(speed.value) }); speed.blur(); };

  const go = (event) => {
    const { left, width } = track.getBoundingClientRect();
    const share = Math.min(Math.max((event.clientX - left) / width, 0), 1);
    if (line !== null) say({ type: "seek", at: share * line.length });
  };
  track.onpointerdown = (event) => { track.setPointerCapture(event.pointerId); go(event); };
  track.onpointermove = (event) => { if (event.buttons) go(event); };

  const draw = () => {
    if (line === null) return;
    const scale = window.devicePixelRatio || 1;
    const [width, height] = [track.clientWidth * scale, track.clientHeight * scale];
    [levels.width, levels.height] = [width, height];
    const pen = levels.getContext("2d");
    const place = (t) => (t / Math.max(line.length, 1e-9)) * width;
    line.states.forEach(([begin, colour], k) => {
      const end = k + 1 < line.states.length ? line.states[k + 1][0] : line.length;
      pen.fillStyle = colour;
      pen.fillRect(place(begin), 0.25 * height, Math.max(place(end) - place(begin), 1), 0.75 * height);
    });
    pen.fillStyle = "#1c2126";
    for (const stop of line.stops) {
      const [x, half] = [place(stop), 4 * scale];
      pen.beginPath();
      pen.moveTo(x - half, 0);
      pen.lineTo(x + half, 0);
      pen.lineTo(x, 0.25 * height);
      pen.fill();
    }
  };
  new ResizeObserver(draw).observe(track);

  return {
    box,
    // The whole recording, once.
    begin: (message) => {
      line = message;
      speed.replaceChildren(...message.speeds.map(([word, value]) => new Option(`${word} ×`, value)));
      speed.value = "1";
      draw();
    },
    // Where it is now.
    show: ({ position, playing }) => {
      if (line === null) return;
      cursor.style.left = `${(100 * position) / Math.max(line.length, 1e-9)}%`;
      play.textContent = playing ? "Pause" : "Play";
      const { length, stops } = line;
      const count = stops.length === 1 ? "1 stop" : `${stops.length} stops`;
      at.textContent = `${position.toFixed(2)} of ${length.toFixed(2)} s · ${count}`;
    },
  };
};
