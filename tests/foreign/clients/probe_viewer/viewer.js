"use strict";
// A viewer of SplatBus 1.0 on a machine without CUDA: it steers, and says what it would show.
const net = require("net");

const HOST = process.env.SPLATBUS_HOST || "127.0.0.1";
const PORTS = {
  ipc: Number(process.env.SPLATBUS_IPC_PORT || 6001),
  msg: Number(process.env.SPLATBUS_MSG_PORT || 6000),
};
const MOST = 1048576;
const HALF = /[\uD800-\uDBFF](?![\uDC00-\uDFFF])|(?<![\uD800-\uDBFF])[\uDC00-\uDFFF]/;
const TOKENS = /"(?:[^"\\]|\\.)*"|[{}[\]:,]/gs;
const utf8 = new TextDecoder("utf-8", { fatal: true, ignoreBOM: true });

// What JSON.parse lets pass and SplatBus does not: a name twice, depth, half a surrogate pair.
function look(text) {
  const open = [];
  let before = null;
  for (const [token] of text.matchAll(TOKENS)) {
    if (token === "{" || token === "[") {
      if (open.push(new Set()) > 64) throw new Error("too deep");
    } else if (token === "}" || token === "]") open.pop();
    else if (token === ":") {
      const name = JSON.parse(before);
      const names = open[open.length - 1];
      if (names.has(name)) throw new Error("a name twice");
      names.add(name);
    } else if (token !== "," && HALF.test(JSON.parse(token))) throw new Error("half a pair");
    before = token;
  }
}

function parse(payload) {
  const text = utf8.decode(payload);
  const value = JSON.parse(text, (_, each) => {
    if (typeof each === "number" && !Number.isFinite(each)) throw new Error("not finite");
    return each;
  });
  look(text);
  if (value === null || typeof value !== "object" || Array.isArray(value)) throw new Error("no object");
  return value;
}

function send(socket, message) {
  const payload = Buffer.from(JSON.stringify(message));
  const packet = Buffer.alloc(4 + payload.length);
  packet.writeUInt32LE(payload.length);
  payload.copy(packet, 4);
  socket.write(packet);
}

// Calls back with each packet of a socket; destroys it at what is no packet, or half of one.
function receive(socket, use) {
  let have = Buffer.alloc(0);
  let late = null;
  socket.on("data", (data) => {
    const had = have.length;
    have = Buffer.concat([have, data]);
    let whole = false;
    while (have.length >= 4 && !socket.destroyed) {
      const length = have.readUInt32LE();
      if (length < 1 || length > MOST) return socket.destroy();
      if (have.length < 4 + length) break;
      const payload = have.subarray(4, 4 + length);
      have = have.subarray(4 + length);
      whole = true;
      use(payload);
    }
    if (whole || !had) {
      clearTimeout(late);
      late = have.length ? setTimeout(() => socket.destroy(), 10000) : null;
    }
  });
  socket.on("close", () => clearTimeout(late));
}

const begun = { ipc: -Infinity, msg: -Infinity };

// Connects, again and again until it is let in: 0.15 s between the first beginnings, 3 s at last.
function connect(channel, met, pause = 150) {
  const wait = Math.max(0, begun[channel] + pause - performance.now());
  setTimeout(() => {
    begun[channel] = performance.now();
    const socket = net.connect({ host: HOST, port: PORTS[channel], noDelay: true });
    let open = false;
    socket.on("connect", () => {
      open = true;
      met(socket);
    });
    socket.on("error", () => {});
    socket.on("close", () => {
      if (!open) connect(channel, met, Math.min(2 * pause, 3000));
    });
  }, wait);
}

const numbers = (value, count) =>
  Array.isArray(value) && value.length === count &&
  value.every((each) => typeof each === "number" && Math.abs(each) <= 3.4028234663852886e38);

function size(reply) {
  const said = reply.viewport_size;
  const good = numbers(said, 2) && said.every((n) => Number.isInteger(n) && n >= 0 && n <= 32768);
  return good ? said : null;
}

function camera(reply) {
  const { position, rotation } = reply;
  const good = numbers(position, 3) && numbers(rotation, 4) && Math.abs(Math.hypot(...rotation) - 1) <= 0.01;
  return good ? position : null;
}

// One question; a reply that is none, or none at all, ends the connection.
class Questions {
  constructor(socket) {
    this.socket = socket;
    this.asked = null;
    receive(socket, (payload) => {
      const question = this.asked;
      if (!question) return;
      try {
        const answer = question.read(parse(payload));
        if (answer === null) throw new Error("no answer");
        clearTimeout(question.late);
        this.asked = null;
        question.use(answer);
      } catch {
        socket.destroy();
      }
    });
    socket.on("close", () => this.asked && clearTimeout(this.asked.late));
  }

  ask(message, read, use) {
    this.asked = { read, use, late: setTimeout(() => this.socket.destroy(), 9000) };
    send(this.socket, message);
  }
}

const handle = (text) =>
  typeof text === "string" && /^[A-Za-z0-9+/]{86}==$/.test(text);
const integer = (value, least, most) => Number.isInteger(value) && value >= least && value <= most;
const offset = (value, unit) => value === undefined || (integer(value, 0, Number.MAX_SAFE_INTEGER) && value % unit === 0);

function announced(packet) {
  const { meta } = packet;
  return (
    !("type" in packet) && meta !== null && typeof meta === "object" &&
    integer(meta.w, 1, 32768) && integer(meta.h, 1, 32768) &&
    meta.fmtColor === "RGBA32F" && meta.fmtDepth === "R32F" &&
    meta.pitchColor === 16 * meta.w && meta.pitchDepth === 4 * meta.w &&
    offset(meta.offsetColor, 16) && offset(meta.offsetDepth, 4) && offset(meta.device, 1) &&
    handle(packet.mem_color) && handle(packet.mem_depth) && handle(packet.evt_done)
  );
}

let centre = null;
let turn = 0;

function images() {
  connect("ipc", (socket) => {
    receive(socket, (payload) => {
      try {
        const packet = parse(payload);
        if (announced(packet)) console.error(`${packet.meta.w}x${packet.meta.h}, and no CUDA to show it`);
      } catch {
        // not for us
      }
    });
    socket.on("close", images);
  });
}

function steer() {
  connect("msg", (socket) => {
    const questions = new Questions(socket);
    let beat = null;
    const move = () => {
      turn += 0.02;
      send(socket, {
        type: "camera_pose",
        position: { x: centre[0] + Math.sin(turn), y: centre[1], z: centre[2] },
        rotation: { x: 0, y: Math.sin(turn / 2), z: 0, w: Math.cos(turn / 2) },
      });
    };
    const begin = () => (beat = setInterval(move, 33));
    if (centre) begin();
    else
      questions.ask({ type: "get_camera_pose", cam_idx: 0 }, camera, (position) => {
        centre = position;
        begin();
      });
    socket.on("close", () => {
      clearInterval(beat);
      steer();
    });
  });
}

// The first pair only asks for the size: of images that it will not see.
function probe() {
  let known = false;
  let other = null;
  connect("ipc", (ipc) => {
    other = ipc;
    receive(ipc, () => {});
    ipc.on("close", images);
    if (known) ipc.destroy();
  });
  const asking = () =>
    connect("msg", (msg) => {
      const questions = new Questions(msg);
      const ask = () =>
        questions.ask({ type: "get_viewport_size" }, size, ([w, h]) => {
          if (w === 0 || h === 0) return setTimeout(() => msg.destroyed || ask(), 250);
          known = true;
          msg.destroy();
          if (other) other.destroy();
        });
      ask();
      msg.on("close", () => (known ? steer() : asking()));
    });
  asking();
}

probe();
