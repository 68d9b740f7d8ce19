// What a page learns of a port, by all the ways there are.
async (port) => {
  const at = `http://127.0.0.1:${port}/`;
  const asked = async (how) => {
    try { const got = await fetch(at, how); return [got.type, got.status].join(); }
    catch (error) { return error.name + error.message; }
  };
  const loaded = (tag, name) => new Promise((done) => {
    const one = document.createElement(tag);
    one.onload = () => done("load");
    one.onerror = () => done("error");
    one[name] = at;
    document.body.append(one);
  });
  const socket = await new Promise((done) => {
    const one = new WebSocket(`ws://127.0.0.1:${port}/`);
    const seen = [];
    one.onopen = () => seen.push("open");
    one.onerror = () => seen.push("error");
    one.onclose = (event) => done([...seen, event.code, event.reason].join());
  });
  return [
    await asked({ mode: "no-cors" }), await asked({ mode: "no-cors", method: "POST" }),
    await asked({ mode: "cors" }), await loaded("img", "src"),
    await loaded("script", "src"), socket,
  ].join(" | ");
}
