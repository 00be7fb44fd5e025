"use strict";
// A window in a browser's shell. It loads other things first, so that its hello is late.
const net = require("net");
const fs = require("fs");

const HOST = process.env.SPLATBUS_HOST || "127.0.0.1";
const PORTS = { ipc: +(process.env.SPLATBUS_IPC_PORT || 6001), msg: +(process.env.SPLATBUS_MSG_PORT || 6000) };
const HELLO_AFTER = 1500, PACKET_MS = 9500, REPLY_MS = 8000, SAFE = Number.MAX_SAFE_INTEGER;
const MARKS = /"(?:[^"\\]|\\.)*"|[[\]{}:]|-?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?/g;
// What 1.2 might be: a capability, its message, a member of `hello`.
const LATER = process.env.SIMULATES === "1.2";
const VERSIONS = LATER ? ["1.2", "1.1", "1.0"] : ["1.1", "1.0"];
const utf8 = new TextDecoder("utf-8", { fatal: true, ignoreBOM: true });

function parsed(payload) {
  const text = utf8.decode(payload);
  const stack = [];
  let last = null;
  for (const [mark] of text.matchAll(MARKS)) {
    if (mark === "{" || mark === "[") {
      if (stack.push(new Set()) > 64) throw new Error("too deep");
    } else if (mark === "}" || mark === "]") stack.pop();
    else if (mark === ":" && last !== null && stack.length) {
      const names = stack[stack.length - 1], name = JSON.parse(last);
      if (names.has(name)) throw new Error("a name twice");
      names.add(name);
    } else if (mark[0] === '"') {
      if (/\p{Surrogate}/u.test(JSON.parse(mark))) throw new Error("half a pair");
    } else if (!Number.isFinite(+mark)) throw new Error("a number without end");
    last = mark[0] === '"' ? mark : null;
  }
  const value = JSON.parse(text);
  if (value === null || typeof value !== "object" || Array.isArray(value)) throw new Error("no object");
  return value;
}

const isInt = (value, low, high) => Number.isInteger(value) && value >= low && value <= high;
const isObject = (value) => value !== null && typeof value === "object" && !Array.isArray(value);

class Line {
  constructor(name, greet, take) {
    Object.assign(this, { name, greet, take, pause: 300 });
    this.open();
  }
  open() {
    const session = (this.session = { timers: [], waiting: [], ended: false });
    const socket = (session.socket = net.connect({ host: HOST, port: PORTS[this.name], noDelay: true }));
    let buffer = Buffer.alloc(0), late = null;
    session.say = (message) => {
      const text = Buffer.from(JSON.stringify(message)), header = Buffer.alloc(4);
      header.writeUInt32LE(text.length);
      if (!session.ended) socket.write(Buffer.concat([header, text]));
    };
    session.end = (why) => {
      if (session.ended) return;
      session.ended = true;
      clearTimeout(late);
      session.timers.forEach((timer) => clearTimeout(timer));
      socket.destroy();
      if (session.memory) fs.closeSync(session.memory.file);
      console.log(this.name, why);
      setTimeout(() => this.open(), this.pause);
      this.pause = Math.min(1.5 * this.pause, 4000);
    };
    socket.on("connect", () => session.timers.push(setTimeout(() => this.greet(session), HELLO_AFTER)));
    socket.on("error", (error) => session.end(error.code));
    socket.on("end", () => session.end("end of stream"));
    socket.on("data", (data) => {
      buffer = Buffer.concat([buffer, data]);
      let whole = false;
      while (buffer.length >= 4 && !session.ended) {
        const length = buffer.readUInt32LE(0);
        if (length < 1 || length > 1 << 20) return session.end(`a length of ${length}`);
        if (buffer.length < 4 + length) break;
        const payload = buffer.subarray(4, 4 + length);
        buffer = buffer.subarray(4 + length);
        whole = true;
        this.hand(session, payload);
      }
      if (session.ended) return;
      if (whole || !buffer.length) { clearTimeout(late); late = null; }
      if (buffer.length && !late) late = setTimeout(() => session.end("half a packet"), PACKET_MS);
    });
  }
  hand(session, payload) {
    let message;
    try { message = parsed(payload); } catch (error) {
      if (session.waiting.length) session.end(`no reply: ${error.message}`);
      return;
    }
    this.take(session, message);
  }
  well() { this.pause = 300; }
}

const me = (capabilities) => ({
  type: "hello", versions: VERSIONS, client: { name: "window", version: "3" },
  capabilities: LATER ? [...capabilities, "exposure"] : capabilities, ...(LATER && { screen: { nits: 1000 } }),
});
const modern = (session) => Boolean(session.version) && session.version !== "1.0";

function welcomed(session, message) {
  if (session.version) return;
  const { version, capabilities } = message;
  if (!VERSIONS.includes(version)) return session.end("a welcome to another version");
  if (!Array.isArray(capabilities)) return session.end("a welcome that is none");
  session.version = version;
  session.can = new Set(version === "1.0" ? [] : capabilities);
}

// ---- images

function faults(packet) {
  const { meta, memory, ring, semantics: s } = packet;
  if (typeof packet.version !== "string" || !/^1\.[1-9][0-9]*$/.test(packet.version) || !isObject(memory) || !isObject(ring) || !isObject(s) || !isObject(s.depth)) return "its form";
  if (!isInt(meta.w, 1, 32768) || !isInt(meta.h, 1, 32768)) return "its size";
  if (meta.fmtColor !== "RGBA32F" || meta.fmtDepth !== "R32F") return "its formats";
  if (meta.pitchColor !== 16 * meta.w || meta.pitchDepth !== 4 * meta.w) return "its pitches";
  if (["offsetColor", "offsetDepth", "device"].some((name, i) =>
    name in meta && (!isInt(meta[name], 0, SAFE) || meta[name] % [16, 4, 1][i]))) return "its offsets";
  if (memory.kind !== "host_shm") return "its kind of memory";
  if (typeof memory.name !== "string" || !/^(?!\.)[A-Za-z0-9._-]{1,30}$/.test(memory.name)) return "its name";
  if (!isInt(memory.bytes, 1, SAFE)) return "its bytes";
  if (!isInt(ring.slots, 1, 1024)) return "its slots";
  const planes = [["color", 16 * meta.w], ["depth", 4 * meta.w]];
  const spans = planes.map(([plane, pitch]) => {
    const offset = ring[`${plane}Offset`], stride = ring[`${plane}Stride`];
    if (!isInt(offset, 0, SAFE) || !isInt(stride, pitch * meta.h, SAFE) || offset % 16 || stride % 16) return null;
    return [BigInt(offset), BigInt(stride), BigInt(pitch * meta.h)];
  });
  if (spans.includes(null)) return "its ring";
  const last = BigInt(ring.slots - 1);
  if (spans.some(([o, d, n]) => o + last * d + n > BigInt(memory.bytes))) return "a ring that is larger than its memory";
  const starts = spans.flatMap(([o, d, n]) => [...Array(ring.slots).keys()].map((k) => [o + BigInt(k) * d, n]));
  starts.sort(([a], [b]) => (a < b ? -1 : a > b ? 1 : 0));
  if (starts.some(([at, n], i) => i && starts[i - 1][0] + starts[i - 1][1] > at)) return "slots that overlap";
  const empty = s.depth.empty;
  if (s.rows !== "bottom_up" || !["straight", "premultiplied"].includes(s.alpha) || !["srgb", "linear"].includes(s.colorSpace) ||
    !["planar_z", "ray_distance"].includes(s.depth.kind) || !["harmonic", "expected", "median"].includes(s.depth.estimator) ||
    !(empty === "inf" || (typeof empty === "number" && Number.isFinite(Math.fround(empty))))) return "its meaning";
  if (!(s.unitMetres === null || (typeof s.unitMetres === "number" && s.unitMetres > 0))) return "its unit";
  if (!Array.isArray(s.origin) || s.origin.length !== 3 || s.origin.some((each) => typeof each !== "number")) return "its origin";
  return null;
}

function announced(session, packet) {
  const { generation } = packet;
  if (!isInt(generation, 1, SAFE) || generation <= (session.generation || 0)) return;
  if (session.generation && !session.can.has("reinit")) return;
  let why = faults(packet), file = null;
  if (!why && !session.can.has("host_shm")) why = "memory that was not agreed upon";
  if (!why) {
    try {
      file = fs.openSync(`/dev/shm/${packet.memory.name}`, fs.constants.O_RDONLY | fs.constants.O_NOFOLLOW);
      if (fs.fstatSync(file).size < packet.memory.bytes) why = "memory that is too short";
    } catch (error) { why = String(error.code); }
  }
  const old = session.memory;
  session.generation = generation;
  session.memory = why ? null : { generation, file, meta: packet.meta, ring: packet.ring };
  if (why && file !== null) fs.closeSync(file);
  session.say(why ? { type: "open_failed", generation, reason: `cannot use ${why}` } : { type: "opened", generation });
  if (!old) return;
  fs.closeSync(old.file);
  session.say({ type: "closed", generation: old.generation });
}

function lent(session, { generation, seq, slot }) {
  const { memory } = session;
  if (!memory || !session.can.has("frames") || generation !== memory.generation || !isInt(slot, 0, memory.ring.slots - 1)) return;
  if (!isInt(seq, 0, SAFE)) return session.end("a frame without a number");
  const { w, h } = memory.meta, { ring, file } = memory;
  const color = Buffer.alloc(16 * w * h), depth = Buffer.alloc(4 * w * h);
  fs.readSync(file, color, 0, color.length, ring.colorOffset + slot * ring.colorStride);
  fs.readSync(file, depth, 0, depth.length, ring.depthOffset + slot * ring.depthStride);
  session.shown = color.readFloatLE(0) + depth.readFloatLE(0);
  session.say({ type: "release", generation, seq });
}

const ipc = new Line("ipc",
  (session) => { if (!session.version) session.say(me(["host_shm", "frames", "reinit"])); },
  (session, message) => {
    if (message.type === "welcome") {
      welcomed(session, message);
      ipc.well();
      const held = session.held;
      session.held = null;
      if (held && modern(session)) announced(session, held);
    } else if (message.type === "frame") { if (modern(session)) lent(session, message);
    } else if (message.type === "error") console.log("ipc", message.code);
    else if (!("type" in message) && isObject(message.meta)) {
      if (modern(session)) { if ("version" in message) announced(session, message);
      } else if (!session.version && !("version" in message)) session.version = "1.0";
      else if (!session.version && !session.held) session.held = message;
    }
  });

// ---- the camera

const SHAPES = {
  get_viewport_size: (m) => Array.isArray(m.viewport_size) && m.viewport_size.length === 2 && m.viewport_size.every((n) => isInt(n, 0, 32768)),
  ping: (m) => typeof m.t === "number" && typeof m.serverTime === "number",
};
const REPLIES = { get_viewport_size: "viewport_size", ping: "pong" };

function ask(session, message) {
  session.waiting.push(message);
  session.say(message);
  session.timers.push((session.limit = setTimeout(() => session.end("no reply"), REPLY_MS)));
}

function steer(session) {
  let turn = 0, id = 0;
  session.timers.push(setInterval(() => {
    turn += 0.02;
    const rotation = { x: 0, y: Math.sin(turn / 2), z: 0, w: Math.cos(turn / 2) };
    if (session.can.has("exposure")) session.say({ type: "set_exposure", stops: Math.sin(turn) });
    session.say({ type: "camera_pose", position: { x: Math.sin(turn), y: 0, z: -3 }, rotation });
  }, 50), setInterval(() => {
    if (session.waiting.length) return;
    if (modern(session) && session.can.has("ping")) ask(session, { type: "ping", t: performance.now() / 1000, id: ++id });
    else ask(session, { type: "get_viewport_size" });
  }, 400));
}

const msg = new Line("msg",
  (session) => {
    session.say(me(["ping"]));
    ask(session, { type: "get_viewport_size" });
  },
  (session, message) => {
    const [asked] = session.waiting, { type } = message;
    if (type === "welcome" && session.version !== "1.0") return welcomed(session, message);
    if (!asked) return;
    if (type === "error" && session.version !== "1.0") {
      if (message.code === "busy" || message.id !== asked.id) return;
    } else if (modern(session) && type !== REPLIES[asked.type]) return;
    else if (!modern(session) && type !== undefined && !("viewport_size" in message)) return;
    else if (!SHAPES[asked.type](message) || (modern(session) && message.id !== asked.id)) return session.end("no reply that it asked for");
    clearTimeout(session.limit);
    session.waiting.shift();
    session.version = session.version || "1.0";
    session.can = session.can || new Set();
    msg.well();
    if (!session.steering) { session.steering = true; steer(session); }
  });
