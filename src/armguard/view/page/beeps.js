// Beeps, in the thread that makes sound: it gets each from the one that reads the
// channel, and neither waits for the drawing.
"use strict";
const LASTS = 0.1; // [s]
const RISES = 0.01; // [s]
const LOUD = 0.25;
const MOST = 8; // beeps that sound, or wait to, at a time

registerProcessor("beeps", class extends AudioWorkletProcessor {
  constructor() {
    super();
    this.tones = [];
    this.port.onmessage = ({ data }) => {
      data.pipe.onmessage = (event) => this.begin(event.data);
    };
  }

  begin(beep) {
    // While nothing is played they would wait, and then sound all at once.
    if (this.tones.length < MOST) this.tones.push({ ...beep, time: 0, noted: false });
  }

  process(_, [[out]]) {
    for (const tone of this.tones) {
      if (!tone.noted) {
        const { name, hertz, level, cycle } = tone;
        this.port.postMessage({ name, hertz, level, cycle, at: Date.now() / 1000 });
        tone.noted = true;
      }
      for (let k = 0; k < out.length; k++, tone.time += 1 / sampleRate) {
        const rises = Math.min(tone.time / RISES, 1);
        const falls = Math.max(1 - tone.time / LASTS, 0);
        const wave = Math.sin(2 * Math.PI * tone.hertz * tone.time);
        // From a stop on they are harsh.
        out[k] += LOUD * rises * falls * (tone.level >= 30 ? Math.sign(wave) : wave);
      }
    }
    this.tones = this.tones.filter((tone) => tone.time < LASTS);
    return true;
  }
});
