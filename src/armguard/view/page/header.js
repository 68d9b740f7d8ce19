// The header as one picture of one message: light, sentence and cards. The thread that
// reads the channel draws it, so that no part of it waits for the page's own thread.
"use strict";
const FONT = 'system-ui, "Segoe UI", "DejaVu Sans", sans-serif';
const GREY = { colour: "#9aa0a6", ink: "#000000", text: "#7b838b" };
const INK = "#1c2126";
const FAINT = "#4a525a";
const WARNING = "#b03a00";
const SMALLEST = 9; // letters are never smaller [px]

// Lines of a text that are no wider than `width` in the pen's font.
const wrapped = (pen, text, width) => {
  const lines = [];
  let line = "";
  for (const word of text.split(" ")) {
    const longer = line ? `${line} ${word}` : word;
    if (line && pen.measureText(longer).width > width) {
      lines.push(line);
      line = word;
    } else line = longer;
  }
  return line ? [...lines, line] : lines;
};

// Write a text into a box with the largest letters that fit; its height [px].
const write = (pen, text, { x, y, width, height, size, weight = 400, colour }) => {
  let lines;
  for (; ; size -= 0.5) {
    pen.font = `${weight} ${size}px ${FONT}`;
    lines = wrapped(pen, text, width);
    const wide = Math.max(0, ...lines.map((line) => pen.measureText(line).width));
    const fits = lines.length * 1.2 * size <= height && wide <= width;
    if (fits || size <= SMALLEST) break;
  }
  pen.fillStyle = colour;
  lines.forEach((line, k) => pen.fillText(line, x, y + k * 1.2 * size));
  return lines.length * 1.2 * size;
};

const rounded = (pen, { x, y, width, height }, colour) => {
  pen.fillStyle = colour;
  pen.beginPath();
  pen.roundRect(x, y, width, height, 8);
  pen.fill();
};

const drawLight = (pen, box, { word, level }, { colour, ink }) => {
  rounded(pen, box, colour);
  const size = 0.42 * box.height;
  pen.font = `800 ${size}px ${FONT}`;
  const fit = Math.min(1, (0.86 * box.width) / pen.measureText(word).width);
  pen.font = `800 ${size * fit}px ${FONT}`;
  pen.fillStyle = pen.strokeStyle = ink;
  pen.textAlign = "center";
  pen.textBaseline = "middle";
  pen.fillText(word, box.x + box.width / 2, box.y + box.height / 2);
  pen.textAlign = "left";
  pen.textBaseline = "top";
  if (level < 30) return;
  pen.lineWidth = 4;
  pen.strokeRect(box.x + 2, box.y + 2, box.width - 4, box.height - 4);
};

const drawWords = (pen, box, { why }, { line, notes }, grey) => {
  const { x, width } = box;
  const small = [
    { text: line, colour: grey ? GREY.text : FAINT },
    ...notes.map((text) => ({ text, colour: grey ? GREY.text : WARNING })),
  ];
  const height = Math.max(box.height - 15 * small.length, 24);
  const colour = grey ? GREY.text : INK;
  let y = box.y + write(pen, why, { ...box, height, size: 15, weight: 600, colour }) + 2;
  for (const one of small) {
    write(pen, one.text, { x, y, width, height: 15, size: 12, colour: one.colour });
    y += 15;
  }
};

const drawCard = (pen, box, robot, grey) => {
  const own = grey ? GREY.colour : robot.colour;
  rounded(pen, box, own);
  rounded(pen, { ...box, x: box.x + 8, width: box.width - 8 }, "#fff");
  const [x, width, colour] = [box.x + 14, box.width - 20, grey ? GREY.text : INK];
  pen.font = `700 14px ${FONT}`;
  const word = pen.measureText(robot.word).width;
  write(pen, robot.word, {
    x: x + width - word, y: box.y + 4, width: word + 1, height: 17, size: 14, weight: 700, colour,
  });
  write(pen, robot.name, {
    x, y: box.y + 4, width: width - word - 6, height: 17, size: 14, weight: 700, colour,
  });
  write(pen, robot.blocked, {
    x, y: box.y + 21, width, height: box.height - 30, size: 12, colour: grey ? GREY.text : FAINT,
  });
  pen.fillStyle = "#dfe3e6";
  pen.fillRect(x, box.y + box.height - 7, width, 4);
  pen.fillStyle = own;
  pen.fillRect(x, box.y + box.height - 7, width * robot.urgency, 4);
};

// Draw a message into the boxes of a layout; all of it is grey where it is old.
const drawHeader = (pen, layout, message, beside, grey) => {
  const { scale, width, height } = layout;
  const look = grey ? GREY : message;
  pen.setTransform(scale, 0, 0, scale, 0, 0);
  pen.clearRect(0, 0, width, height);
  pen.fillStyle = look.colour;
  pen.fillRect(0, height - 5, width, 5);
  pen.textBaseline = "top";
  drawLight(pen, layout.light, message, look);
  drawWords(pen, layout.words, message, beside, grey);
  message.robots.forEach((robot, k) => {
    if (layout.cards[k]) drawCard(pen, layout.cards[k], robot, grey);
  });
};
