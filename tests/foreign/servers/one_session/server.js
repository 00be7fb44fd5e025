"use strict";
// A renderer on a shared machine: it loads when it is started, and frees the machine when nobody looks any more.
const net = require("net");
const { parsed, isInt } = require("./text");

const MOST = 1 << 20, SAFE = Number.MAX_SAFE_INTEGER, PLACES = 5, LINGER_MS = 1500;
const CAMERAS = [[[0, 0, -2], [0, 0, 0, 1]], [[1, 0, -2], [0, -0.6, 0, 0.8]], [[0.5, 1e-7, 2], [0, 1, 0, 0]], [[0, -3, 0], [-0.6, 0, 0, 0.8]]];
const open = { ipc: new Set(), msg: new Set() };
let sessions = 0, going = null;

function reply(socket, value) {
  const text = JSON.stringify(value, null, 1), packet = Buffer.alloc(4 + Buffer.byteLength(text));
  packet.writeUInt32LE(packet.length - 4);
  packet.write(text, 4);
  socket.write(packet);
  if (socket.writableLength > MOST) socket.destroy();
}

function answer(socket, { type, cam_idx: index }) {
  if (type === "get_viewport_size") reply(socket, { viewport_size: [0, 0] });
  if (type !== "get_camera_pose") return;
  if (!isInt(index, -SAFE, SAFE)) return socket.destroy(); // nothing would come: it learns that at once
  const [position, rotation] = CAMERAS[((index % CAMERAS.length) + CAMERAS.length) % CAMERAS.length];
  reply(socket, { rotation, position });
}

function leave(name, socket, byItself) {
  open[name].delete(socket);
  clearTimeout(going);
  if (!byItself || !sessions) return;
  going = setTimeout(() => {
    if (open.ipc.size || open.msg.size) return;
    console.log("nobody looks");
    process.exit(0);
  }, LINGER_MS);
}

function serve(name, socket) {
  if (open[name].size >= PLACES) return socket.destroy();
  open[name].add(socket);
  clearTimeout(going);
  let buffer = Buffer.alloc(0), half = null, stalled = null, byItself = false;
  socket.setNoDelay(true);
  socket.on("error", () => { byItself = true; });
  socket.on("end", () => { byItself = true; socket.end(); });
  socket.on("close", () => {
    clearTimeout(half);
    clearInterval(stalled);
    leave(name, socket, byItself);
  });
  let written = 0, waited = false;
  stalled = setInterval(() => {
    const sent = socket.bytesWritten - socket.writableLength, waits = socket.writableLength > 0;
    if (waits && waited && sent === written) socket.destroy(); // twice: it may have come this instant
    [written, waited] = [sent, waits];
  }, 1600);
  socket.on("data", (data) => {
    buffer = buffer.length ? Buffer.concat([buffer, data]) : data;
    while (buffer.length >= 4 && !socket.destroyed) {
      const length = buffer.readUInt32LE(0);
      if (length < 1 || length > MOST) return socket.destroy();
      if (buffer.length < 4 + length) break;
      const payload = buffer.subarray(4, 4 + length);
      buffer = buffer.subarray(4 + length);
      clearTimeout(half);
      half = null;
      if (name === "ipc") continue;
      sessions += 1;
      let message = null;
      try { message = parsed(payload); } catch (error) { continue; }
      answer(socket, message);
    }
    if (buffer.length && !half) half = setTimeout(() => socket.destroy(), 9800);
  });
}

for (const [name, port] of [["msg", process.env.SPLATBUS_MSG_PORT || 6000], ["ipc", process.env.SPLATBUS_IPC_PORT || 6001]]) {
  net.createServer({ allowHalfOpen: true }, (socket) => serve(name, socket)).listen(+port, "127.0.0.1");
}
