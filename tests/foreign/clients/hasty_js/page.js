"use strict";
// A page that shows splats: SplatBus 1.1 in two hundred lines, for a server that is right.
const fs = require("fs");
const net = require("net");

const utf8 = new TextDecoder("utf-8", { fatal: true, ignoreBOM: true });
const HALF = /[\uD800-\uDBFF](?![\uDC00-\uDFFF])|(?<![\uD800-\uDBFF])[\uDC00-\uDFFF]/;

// Recursive descent; throws at what is no message.
function parse(payload) {
  const text = utf8.decode(payload);
  let at = 0;
  const fail = () => {
    throw new Error(`no JSON at ${at}`);
  };
  const blank = () => {
    while (" \t\n\r".includes(text[at] || "x")) at++;
  };
  const take = (pattern) => {
    pattern.lastIndex = at;
    const found = pattern.exec(text);
    if (!found) fail();
    at = pattern.lastIndex;
    return found[0];
  };
  const string = () => {
    const read = JSON.parse(take(/"(?:[^"\\]|\\.)*"/y));
    if (HALF.test(read)) fail();
    return read;
  };
  const value = (depth) => {
    blank();
    const first = text[at];
    if (first === '"') return string();
    if (first !== "{" && first !== "[") {
      const word = take(/null|true|false|-?(?:0|[1-9]\d*)(?:\.\d+)?(?:[eE][-+]?\d+)?/y);
      const read = JSON.parse(word);
      if (typeof read === "number" && !Number.isFinite(read)) fail();
      return read;
    }
    if (depth > 64) fail();
    const close = first === "{" ? "}" : "]";
    const made = first === "{" ? new Map() : [];
    at++;
    blank();
    if (text[at] === close) at++;
    else
      for (let more = true; more; ) {
        blank();
        if (first === "{") {
          const name = string();
          blank();
          if (text[at++] !== ":" || made.has(name)) fail();
          made.set(name, value(depth + 1));
        } else made.push(value(depth + 1));
        blank();
        more = text[at] === ",";
        if (!more && text[at] !== close) fail();
        at++;
      }
    return first === "{" ? Object.fromEntries(made) : made;
  };
  const root = value(1);
  blank();
  if (at !== text.length || root === null || typeof root !== "object" || Array.isArray(root)) fail();
  return root;
}

class Link {
  constructor(port, capabilities) {
    Object.assign(this, { port, capabilities, begun: -Infinity });
    this.dial(0);
  }

  dial(pause) {
    setTimeout(() => {
      this.begun = performance.now();
      this.granted = this.blamed = null;
      this.have = Buffer.alloc(0);
      const options = { host: process.env.SPLATBUS_HOST, port: Number(this.port), noDelay: true };
      this.socket = net.connect(options);
      this.socket.on("connect", () => {
        const client = { name: "page", version: "3" };
        this.say("hello", { versions: ["1.1", "1.0"], client, capabilities: this.capabilities });
        this.met();
      });
      this.socket.on("data", (data) => this.take(data));
      this.socket.on("error", () => {});
      this.socket.on("close", () => {
        clearTimeout(this.late);
        this.lost();
        this.dial(this.blamed ? 0 : Math.max(200, this.begun + 300 - performance.now()));
      });
    }, pause);
  }

  say(type, members) {
    if (this.socket.destroyed) return;
    const payload = Buffer.from(JSON.stringify({ type, ...members }));
    const header = Buffer.alloc(4);
    header.writeUInt32LE(payload.length);
    this.socket.write(Buffer.concat([header, payload]));
  }

  take(data) {
    this.have = Buffer.concat([this.have, data]);
    while (this.have.length >= 4 && !this.socket.destroyed) {
      const length = this.have.readUInt32LE();
      if (length < 1 || length > 1 << 20) return this.socket.destroy();
      if (this.have.length < 4 + length) break;
      const payload = this.have.subarray(4, 4 + length);
      this.have = this.have.subarray(4 + length);
      let message = null;
      try {
        message = parse(payload);
      } catch {
        continue;
      }
      this.heard(message);
    }
    clearTimeout(this.late);
    if (this.have.length) this.late = setTimeout(() => this.socket.destroy(), 10000);
  }

  heard(message) {
    if (message.type === "error") {
      this.blamed = message;
      this.socket.destroy();
    } else if (message.type === "welcome") {
      this.old = message.version === "1.0";
      this.granted = Array.isArray(message.capabilities) ? message.capabilities : [];
      this.welcomed();
    } else this.handle(message);
  }
}

class Images extends Link {
  met() {
    this.file = null;
    this.held = null;
    this.old = false;
  }

  lost() {
    if (this.file) fs.closeSync(this.file);
    this.file = null;
  }

  welcomed() {
    if (this.held && !this.old) this.open(this.held);
    this.held = null;
  }

  handle(message) {
    if (message.type === "frame") this.frame(message);
    else if (!("type" in message) && message.meta && !this.old) {
      if (this.granted) this.open(message);
      else if (message.version === undefined) this.old = true;
      else this.held = message;
    }
  }

  open(packet) {
    const { meta, generation } = packet;
    if (!Number.isSafeInteger(generation) || generation < 1) return;
    try {
      if (![meta.w, meta.h].every((n) => Number.isInteger(n) && n > 0 && n <= 32768)) throw new Error("size");
      if (meta.pitchColor !== 16 * meta.w || meta.pitchDepth !== 4 * meta.w) throw new Error("pitch");
      if (meta.fmtColor !== "RGBA32F" || meta.fmtDepth !== "R32F") throw new Error("format");
      const before = this.file;
      this.file = fs.openSync(`/dev/shm/${packet.memory.name}`, "r");
      if (before) fs.closeSync(before);
      Object.assign(this, { generation, ring: packet.ring, meta });
      this.say("opened", { generation });
    } catch (error) {
      this.say("open_failed", { generation, reason: error.code || "cannot be read" });
    }
  }

  frame({ generation, seq, slot, camera }) {
    if (!this.file || generation !== this.generation || !(slot >= 0 && slot < this.ring.slots)) return;
    if (!camera || !Array.isArray(camera.position)) return;
    const row = Buffer.alloc(16 * this.meta.w);
    const at = this.ring.colorOffset + slot * this.ring.colorStride;
    try {
      fs.readSync(this.file, row, 0, row.length, at + row.length * Math.floor(this.meta.h / 2));
    } catch {
      console.error(`nothing at ${at}`);
    }
    this.say("release", { generation, seq });
  }
}

class Keys extends Link {
  met() {
    this.old = false;
    this.count = 0;
    this.say("ping", { t: performance.now() / 1000 });
    this.say("get_viewport_size");
  }

  lost() {
    clearInterval(this.beat);
  }

  welcomed() {
    clearInterval(this.beat);
    this.beat = setInterval(() => this.move(!this.old), 40);
  }

  handle(message) {
    if (!this.granted && "viewport_size" in message && !this.old) {
      this.old = true;
      this.beat = setInterval(() => this.move(false), 40);
    }
  }

  move(later) {
    const turn = this.count++ / 50;
    const intrinsics = { fx: 60, fy: 60, cx: 32, cy: 24, width: 64, height: 48, near: 0, far: 100 };
    const more = later ? { tag: this.count } : {};
    if (later && this.granted.includes("intrinsics")) Object.assign(more, { intrinsics });
    this.say("camera_pose", {
      position: { x: Math.sin(turn), y: 0, z: -4 },
      rotation: { x: 0, y: Math.sin(turn / 9), z: 0, w: Math.cos(turn / 9) },
      ...more,
    });
  }
}

new Images(process.env.SPLATBUS_IPC_PORT, ["host_shm", "frames", "reinit"]);
new Keys(process.env.SPLATBUS_MSG_PORT, ["intrinsics", "ping"]);
