// The diagrams of a map: the time of one robot's plan to the right, that of the other one
// upwards. Dragging moves both robots there; a dot shows where they are.
"use strict";
const makeDiagrams = (say) => {
  const SIDE = 260; // longest side of a diagram [px]
  const [LEFT, TOP, RIGHT, BOTTOM] = [34, 20, 8, 32]; // room for axes [px]
  const WAY = "#1f5fa8";
  const box = document.createElement("section");
  box.id = "diagrams";
  box.hidden = true;
  let each = [];

  // The cells as a picture, one pixel each, the second axis upwards.
  const picture = ({ shape: [k, m], cells, colours }) => {
    const made = document.createElement("canvas");
    [made.width, made.height] = [k, m];
    const pen = made.getContext("2d");
    pen.fillStyle = "#ffffff";
    pen.fillRect(0, 0, k, m);
    const labels = Uint8Array.from(atob(cells), (one) => one.charCodeAt(0));
    labels.forEach((label, at) => {
      if (!label) return;
      pen.fillStyle = colours[label];
      pen.fillRect(Math.floor(at / m), m - 1 - (at % m), 1, 1);
    });
    return made;
  };

  const made = (diagram) => {
    const canvas = document.createElement("canvas");
    box.append(canvas);
    const pixels = SIDE / Math.max(...diagram.durations);
    const [width, height] = diagram.durations.map((time) => time * pixels);
    const scale = window.devicePixelRatio || 1;
    const [wide, high] = [width + LEFT + RIGHT, height + TOP + BOTTOM];
    [canvas.width, canvas.height] = [wide * scale, high * scale];
    [canvas.style.width, canvas.style.height] = [`${wide}px`, `${high}px`];
    canvas.title = "drag: both robots go to these times of their plans";
    const pen = canvas.getContext("2d");
    pen.scale(scale, scale);
    const image = picture(diagram);
    const [starts, robots] = [diagram.starts, diagram.robots];
    const x = (time) => LEFT + (time - starts[0]) * pixels;
    const y = (time) => TOP + height - (time - starts[1]) * pixels;

    const segmentOf = (own, time) => own.findLast(([, start]) => start <= time + 1e-9)?.[0] ?? "";
    const axes = () => {
      pen.strokeStyle = "#0003";
      pen.lineWidth = 1;
      pen.beginPath();
      for (const [, start] of diagram.segments[0].slice(1)) {
        pen.moveTo(x(start), TOP);
        pen.lineTo(x(start), TOP + height);
      }
      for (const [, start] of diagram.segments[1].slice(1)) {
        pen.moveTo(LEFT, y(start));
        pen.lineTo(LEFT + width, y(start));
      }
      pen.stroke();
      pen.strokeStyle = "#5b646d";
      pen.strokeRect(LEFT, TOP, width, height);
      pen.fillStyle = "#4a525a";
      pen.font = "11px system-ui, DejaVu Sans, sans-serif";
      pen.textAlign = "center";
      pen.fillText(`time of ${robots[0]}'s plan [s]`, LEFT + width / 2, TOP + height + 28);
      const ends = starts.map((start, k) => start + diagram.durations[k]);
      pen.fillText(starts[0].toFixed(1), LEFT, TOP + height + 14);
      pen.fillText(ends[0].toFixed(1), LEFT + width - 8, TOP + height + 14);
      pen.textAlign = "right";
      pen.fillText(starts[1].toFixed(1), LEFT - 4, TOP + height);
      pen.fillText(ends[1].toFixed(1), LEFT - 4, TOP + 10);
      pen.save();
      pen.translate(12, TOP + height / 2);
      pen.rotate(-Math.PI / 2);
      pen.textAlign = "center";
      pen.fillText(`time of ${robots[1]}'s plan [s]`, 0, 0);
      pen.restore();
    };

    const draw = (places) => {
      const at = robots.map((robot) => places[robot]);
      pen.clearRect(0, 0, wide, high);
      pen.imageSmoothingEnabled = false;
      const [k, m] = diagram.shape.map((count) => count * diagram.step * pixels);
      pen.save();
      pen.beginPath();
      pen.rect(LEFT, TOP, width, height);
      pen.clip();
      pen.drawImage(image, LEFT, TOP + height - m, k, m);
      pen.restore();
      axes();
      pen.font = "12px system-ui, DejaVu Sans, sans-serif";
      pen.fillStyle = "#000000";
      pen.textAlign = "center";
      for (const [word, i, j] of diagram.words) {
        pen.fillText(word, LEFT + i * k, TOP + height - j * m + 4);
      }
      pen.strokeStyle = WAY;
      pen.lineWidth = 2;
      pen.beginPath();
      for (const [a, b] of diagram.way) pen.lineTo(x(a), y(b));
      pen.stroke();
      pen.lineWidth = 1;
      pen.beginPath();
      pen.moveTo(x(at[0]), TOP);
      pen.lineTo(x(at[0]), TOP + height);
      pen.moveTo(LEFT, y(at[1]));
      pen.lineTo(LEFT + width, y(at[1]));
      pen.stroke();
      pen.fillStyle = WAY;
      pen.beginPath();
      pen.arc(x(at[0]), y(at[1]), 6, 0, 2 * Math.PI);
      pen.fill();
      pen.fillStyle = "#1c2126";
      pen.textAlign = "left";
      const does = robots.map((robot, k) => `${robot}: ${segmentOf(diagram.segments[k], at[k])}`);
      pen.fillText(does.join(" · "), LEFT, 13);
    };

    const go = (event) => {
      const { left, top } = canvas.getBoundingClientRect();
      const times = [
        starts[0] + (event.clientX - left - LEFT) / pixels,
        starts[1] + (TOP + height - (event.clientY - top)) / pixels,
      ];
      say({ type: "place", places: Object.fromEntries(robots.map((robot, k) => [robot, times[k]])) });
    };
    canvas.onpointerdown = (event) => { canvas.setPointerCapture(event.pointerId); go(event); };
    canvas.onpointermove = (event) => { if (event.buttons) go(event); };
    return draw;
  };

  return {
    box,
    begin: (message) => {
      box.replaceChildren();
      each = message.each.map(made);
      box.hidden = false;
    },
    show: (places) => each.forEach((draw) => draw(places)),
  };
};
