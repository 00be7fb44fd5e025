"use strict";
// JSON with nothing twice, nothing infinite, nothing too deep, in one walk over the characters.

const PLAIN = { '"': '"', "\\": "\\", "/": "/", b: "\b", f: "\f", n: "\n", r: "\r", t: "\t" };
const NUMBER = /-?(?:0|[1-9]\d*)(?:\.\d+)?(?:[eE][+-]?\d+)?/y;
const decoder = new TextDecoder("utf-8", { fatal: true, ignoreBOM: true });

exports.parsed = function parsed(payload) {
  const text = decoder.decode(payload);
  let at = 0;
  const fail = () => { throw new SyntaxError(`at ${at}`); };
  const next = () => { while (" \t\r\n".includes(text[at]) && at < text.length) at++; return text[at]; };
  const expect = (c) => { if (next() !== c) fail(); at++; };

  function string() {
    expect('"');
    let out = "";
    for (;;) {
      const from = at;
      while (at < text.length && text[at] !== '"' && text[at] !== "\\" && text[at] >= " ") at++;
      out += text.slice(from, at);
      if (text[at] === '"') break;
      if (text[at] !== "\\") fail();
      const escape = text[at + 1];
      if (escape === "u") {
        const digits = text.slice(at + 2, at + 6);
        if (!/^[0-9a-fA-F]{4}$/.test(digits)) fail();
        out += String.fromCharCode(parseInt(digits, 16));
        at += 6;
      } else if (escape in PLAIN) { out += PLAIN[escape]; at += 2; } else fail();
    }
    at++;
    if (/\p{Surrogate}/u.test(out)) fail();
    return out;
  }

  function value(depth) {
    const c = next();
    if (c === '"') return string();
    if (c === "{" || c === "[") {
      if (depth > 64) fail();
      const close = c === "{" ? "}" : "]", out = c === "{" ? Object.create(null) : [];
      at++;
      if (next() === close) { at++; return out; }
      for (;;) {
        if (c === "[") out.push(value(depth + 1));
        else {
          next();
          const name = string();
          if (name in out) fail();
          expect(":");
          out[name] = value(depth + 1);
        }
        if (next() === close) { at++; return out; }
        expect(",");
      }
    }
    for (const [word, meant] of [["true", true], ["false", false], ["null", null]]) {
      if (text.startsWith(word, at)) { at += word.length; return meant; }
    }
    NUMBER.lastIndex = at;
    const match = NUMBER.exec(text);
    if (!match || !Number.isFinite(+match[0])) fail();
    at = NUMBER.lastIndex;
    return +match[0];
  }

  const it = value(1);
  if (next() !== undefined || !exports.isObject(it)) fail();
  return it;
};
exports.isObject = (value) => value !== null && typeof value === "object" && !Array.isArray(value);
exports.isNumber = (value) => typeof value === "number";
exports.isInt = (value, low, high) => Number.isInteger(value) && value >= low && value <= high;
