// A coordination on line in words: what robots do, which one yields and why, how
// many items are done, and the last decisions.
"use strict";
const makeLine = () => {
  const make = (tag, name, parent) => {
    const made = document.createElement(tag);
    made.className = name;
    parent?.append(made);
    return made;
  };
  const box = make("section", "");
  box.id = "line";
  box.hidden = true;
  make("b", "", box).textContent = "Coordination on line";
  const counted = make("div", "", box);
  const about = make("p", "", box);
  const robots = make("div", "robots", box);
  const fault = make("p", "fault", box);
  const decisions = make("ol", "", box);
  const counts = (message) => {
    const words = [`${message.done} jobs done`, `${message.missed} missed`, `${message.waiting} waiting`];
    if (message.belt) words.push(`belt ${message.belt[0].toFixed(2)} m/s`);
    return words.join(" · ");
  };
  const aboutOf = ({ ended, fault }) => {
    if (ended) return "The coordination does not answer any more.";
    if (fault) return "After a stop all robots wait, or are led slowly to where their plans begin. Jobs that came before are missed.";
    return "Each job goes to a robot that can do it in time. Where their ways cross, one robot yields until the other has passed.";
  };
  const row = (robot) => {
    const made = make("div", robot.yields ? "yields" : "", robots);
    made.style.setProperty("--tint", robot.colour);
    make("b", "", made).textContent = robot.name;
    make("span", "", made).textContent = robot.does;
    make("i", "", made).style.width = `${100 * robot.share}%`;
  };
  const show = (message) => {
    box.hidden = message.robots.length === 0;
    if (box.hidden) return;
    counted.textContent = counts(message);
    about.textContent = aboutOf(message);
    robots.replaceChildren();
    message.robots.forEach(row);
    fault.textContent = message.fault && `All stop: ${message.fault}`;
    decisions.replaceChildren();
    for (const [at, said] of [...message.decisions].reverse()) {
      make("li", "", decisions).textContent = `${at.toFixed(1)} s ${said}`;
    }
  };
  return { box, show };
};
