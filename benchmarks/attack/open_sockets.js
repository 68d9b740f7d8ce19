// Opens sockets, some at a time, and sends messages as soon as one is open.
async ([port, protocol, messages, count, atATime]) => {
  let opened = 0;
  for (let left = count; left > 0; left -= atATime) {
    await Promise.all(Array.from({ length: Math.min(left, atATime) }, () => {
      const one = new WebSocket(`ws://127.0.0.1:${port}/`, [protocol]);
      return new Promise((done) => {
        one.onopen = () => {
          opened += 1;
          for (const bytes of messages) one.send(new Uint8Array(bytes));
          setTimeout(() => { one.close(); done(); }, 1000);
        };
        one.onerror = one.onclose = done;
      });
    }));
  }
  return opened;
}
