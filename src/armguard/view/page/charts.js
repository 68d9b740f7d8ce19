// Charts of the free places of two axes: times of plans, or joints. Dragging moves the
// robots there; a dot shows where they are.
"use strict";
const makeCharts = (say) => {
  const SIDE = 260; // longest side of a chart [px]
  const [LEFT, TOP, RIGHT, BOTTOM] = [46, 20, 8, 32]; // room for axes [px]
  const WAY = "#1f5fa8";
  const box = document.createElement("section");
  box.id = "charts";
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

  const made = (chart) => {
    const canvas = document.createElement("canvas");
    box.append(canvas);
    const { axes, titles, lower, upper, segments } = chart;
    const pixels = SIDE / Math.max(upper[0] - lower[0], upper[1] - lower[1]);
    const [width, height] = upper.map((end, k) => (end - lower[k]) * pixels);
    const scale = window.devicePixelRatio || 1;
    const [wide, high] = [width + LEFT + RIGHT, height + TOP + BOTTOM];
    [canvas.width, canvas.height] = [wide * scale, high * scale];
    [canvas.style.width, canvas.style.height] = [`${wide}px`, `${high}px`];
    canvas.title = "drag: the robots go there";
    const pen = canvas.getContext("2d");
    pen.scale(scale, scale);
    const image = picture(chart);
    const x = (at) => LEFT + (at - lower[0]) * pixels;
    const y = (at) => TOP + height - (at - lower[1]) * pixels;

    // Where an axis is, in words: a named part of a plan, or a number.
    const saysOf = (k, at) => {
      const part = segments[k].findLast(([, start]) => start <= at + 1e-9)?.[0];
      return `${axes[k]}: ${part ?? at.toFixed(2)}`;
    };
    const drawAxes = () => {
      pen.strokeStyle = "#0003";
      pen.lineWidth = 1;
      pen.beginPath();
      for (const [, start] of segments[0].slice(1)) {
        pen.moveTo(x(start), TOP);
        pen.lineTo(x(start), TOP + height);
      }
      for (const [, start] of segments[1].slice(1)) {
        pen.moveTo(LEFT, y(start));
        pen.lineTo(LEFT + width, y(start));
      }
      pen.stroke();
      pen.strokeStyle = "#5b646d";
      pen.strokeRect(LEFT, TOP, width, height);
      pen.fillStyle = "#4a525a";
      pen.font = "11px system-ui, DejaVu Sans, sans-serif";
      pen.textAlign = "center";
      pen.fillText(titles[0], LEFT + width / 2, TOP + height + 28);
      pen.fillText(lower[0].toFixed(1), LEFT, TOP + height + 14);
      pen.fillText(upper[0].toFixed(1), LEFT + width - 8, TOP + height + 14);
      pen.textAlign = "right";
      pen.fillText(lower[1].toFixed(1), LEFT - 4, TOP + height);
      pen.fillText(upper[1].toFixed(1), LEFT - 4, TOP + 10);
      pen.save();
      pen.translate(12, TOP + height / 2);
      pen.rotate(-Math.PI / 2);
      pen.textAlign = "center";
      pen.fillText(titles[1], 0, 0);
      pen.restore();
    };

    const draw = (places) => {
      const at = axes.map((axis) => places[axis]);
      pen.clearRect(0, 0, wide, high);
      pen.imageSmoothingEnabled = false;
      const [k, m] = chart.shape.map((count) => count * chart.step * pixels);
      pen.save();
      pen.beginPath();
      pen.rect(LEFT, TOP, width, height);
      pen.clip();
      pen.drawImage(image, LEFT, TOP + height - m, k, m);
      pen.restore();
      drawAxes();
      pen.font = "12px system-ui, DejaVu Sans, sans-serif";
      pen.fillStyle = "#000000";
      pen.textAlign = "center";
      for (const [word, i, j] of chart.words) {
        pen.fillText(word, LEFT + i * k, TOP + height - j * m + 4);
      }
      pen.strokeStyle = WAY;
      pen.lineWidth = 2;
      pen.beginPath();
      for (const [a, b] of chart.way) pen.lineTo(x(a), y(b));
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
      pen.fillText(at.map((one, k) => saysOf(k, one)).join(" · "), LEFT, 13, width);
    };

    const go = (event) => {
      const { left, top } = canvas.getBoundingClientRect();
      const at = [
        lower[0] + (event.clientX - left - LEFT) / pixels,
        lower[1] + (TOP + height - (event.clientY - top)) / pixels,
      ];
      say({ type: "place", places: Object.fromEntries(axes.map((axis, k) => [axis, at[k]])) });
    };
    canvas.onpointerdown = (event) => { canvas.setPointerCapture(event.pointerId); go(event); };
    canvas.onpointermove = (event) => { if (event.buttons) go(event); };
    return draw;
  };

  return {
    box,
    begin: (message) => {
      box.replaceChildren();
      each = message.charts.map(made);
      box.hidden = false;
    },
    show: (places) => each.forEach((draw) => draw(places)),
  };
};
