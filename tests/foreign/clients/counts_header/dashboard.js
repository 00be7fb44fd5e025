"use strict";
// A dashboard: which camera, which size. The length is that of the packet, header and all.
const net = require("net");

const utf8 = new TextDecoder("utf-8", { fatal: true });

function send(socket, message) {
  const payload = Buffer.from(JSON.stringify(message));
  const header = Buffer.alloc(4);
  header.writeUInt32LE(payload.length + 4);
  socket.write(Buffer.concat([header, payload]));
}

function dial(port, met) {
  const socket = net.connect({ host: process.env.SPLATBUS_HOST, port: Number(port), noDelay: true });
  let timers = [];
  let have = Buffer.alloc(0);
  socket.on("connect", () => (timers = met(socket)));
  socket.on("data", (data) => {
    have = Buffer.concat([have, data]);
    while (have.length >= 4) {
      const length = have.readUInt32LE();
      if (length < 4 || length > 1048576) return socket.destroy();
      if (have.length < length) return;
      try {
        console.log(JSON.parse(utf8.decode(have.subarray(4, length))));
      } catch {
        console.error("no JSON");
      }
      have = have.subarray(length);
    }
  });
  socket.on("error", () => {});
  socket.on("close", () => {
    timers.forEach(clearInterval);
    dial(port, met);
  });
}

dial(process.env.SPLATBUS_IPC_PORT, () => []);
dial(process.env.SPLATBUS_MSG_PORT, (socket) => [
  setInterval(() => send(socket, { type: "get_viewport_size" }), 100),
  setInterval(() => send(socket, { type: "get_camera_pose", cam_idx: 0 }), 130),
]);
