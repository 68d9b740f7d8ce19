// Drawing takes half of the time at most. Where a page is drawn without a graphics card one
// picture takes a tenth of a second on all processors; what else is to be done in time,
// light, sound and the button that stops, gets the other half.
"use strict";
(() => {
  const QUICK = 60; // a picture that takes less needs no rest after it [ms]
  const LONGEST = 400; // rest after one that took very long [ms]
  const ask = window.requestAnimationFrame.bind(window);
  const cancel = window.cancelAnimationFrame.bind(window);
  const asked = new Map(); // how each request that waits is called off
  let last = 0;
  let rests = -Infinity; // until when [ms]

  window.requestAnimationFrame = (draw) => {
    const id = ++last;
    const begin = () => {
      const began = performance.now();
      const turn = ask((time) => {
        asked.delete(id);
        draw(time);
        const took = performance.now() - began;
        if (took > QUICK) rests = performance.now() + Math.min(took, LONGEST);
      });
      asked.set(id, () => cancel(turn));
    };
    const rest = rests - performance.now();
    if (rest > 0) {
      const timer = setTimeout(begin, rest);
      asked.set(id, () => clearTimeout(timer));
    } else {
      begin();
    }
    return id;
  };

  window.cancelAnimationFrame = (id) => {
    asked.get(id)?.();
    asked.delete(id);
  };
})();
