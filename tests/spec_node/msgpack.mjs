// Msgpack, as much of it as section 2 of SPEC.md wants. Integers are BigInt, floats number, bin Buffer, maps Map.
// Written from SPEC.md alone, and must stay so: what it cannot know from there is SPEC.md's fault.
export class Refused extends Error {
  constructor(reason, detail = '') {
    super(`${reason}: ${detail}`);
    this.reason = reason;
  }
}

export function refuse(reason, detail) {
  throw new Refused(reason, detail);
}

class Extension {}
const utf8 = new TextDecoder('utf-8', { fatal: true, ignoreBOM: true });

export function text(bytes, reason) {
  try {
    return utf8.decode(bytes);
  } catch {
    return refuse(reason, 'not UTF-8');
  }
}

// The one value that fills `bytes`.
export function unpack(bytes, { levels, elements }) {
  let at = 0;

  function take(count) {
    if (at + count > bytes.length) refuse('msgpack', 'cut short');
    at += count;
    return bytes.subarray(at - count, at);
  }
  function unsigned(width) {
    return BigInt(`0x${take(width).toString('hex')}`);
  }
  function size(width) {
    return Number(unsigned(width));
  }
  function container(count, level, made, read) {
    if (level > levels) refuse('depth');
    if (count > elements) refuse('msgpack', `${count} elements`);
    for (let i = 0; i < count; i++) read(made, level);
    return made;
  }
  function array(count, level) {
    return container(count, level, [], (made, inside) => made.push(value(inside)));
  }
  function map(count, level) {
    return container(count, level, new Map(), (made, inside) => {
      const key = value(inside);
      if (typeof key !== 'string' && !Buffer.isBuffer(key)) refuse('msgpack', 'a key that is neither str nor bin');
      made.set(key, value(inside));
    });
  }
  function extension(count) {
    take(1 + count);
    return new Extension();
  }
  function value(level) {
    const first = take(1)[0];
    if (first <= 0x7f) return BigInt(first);
    if (first <= 0x8f) return map(first & 15, level + 1);
    if (first <= 0x9f) return array(first & 15, level + 1);
    if (first <= 0xbf) return text(take(first & 31), 'msgpack');
    if (first >= 0xe0) return BigInt(first) - 256n;
    if (first === 0xc0) return null;
    if (first === 0xc1) return refuse('msgpack', 'c1');
    if (first <= 0xc3) return first === 0xc3;
    if (first <= 0xc6) return take(size(1 << (first - 0xc4)));
    if (first <= 0xc9) return extension(size(1 << (first - 0xc7)));
    if (first === 0xca) return take(4).readFloatBE();
    if (first === 0xcb) return take(8).readDoubleBE();
    if (first <= 0xcf) return unsigned(1 << (first - 0xcc));
    if (first <= 0xd3) return BigInt.asIntN(8 << (first - 0xd0), unsigned(1 << (first - 0xd0)));
    if (first <= 0xd8) return extension(1 << (first - 0xd4));
    if (first <= 0xdb) return text(take(size(1 << (first - 0xd9))), 'msgpack');
    if (first <= 0xdd) return array(size(2 << (first - 0xdc)), level + 1);
    return map(size(2 << (first - 0xde)), level + 1);
  }

  const only = value(0);
  if (at !== bytes.length) refuse('msgpack', 'bytes after it');
  return only;
}

// The shortest form; for what the decoder gave, with plain objects for maps. A number is a float, a BigInt an integer.
export function pack(value) {
  if (value === null) return Buffer.from([0xc0]);
  if (typeof value === 'boolean') return Buffer.from([value ? 0xc3 : 0xc2]);
  if (typeof value === 'bigint') return integer(value);
  if (typeof value === 'number') {
    const bytes = Buffer.alloc(9, 0xcb);
    bytes.writeDoubleBE(value, 1);
    return bytes;
  }
  if (typeof value === 'string') {
    const bytes = Buffer.from(value);
    const first = bytes.length <= 31 ? Buffer.from([0xa0 | bytes.length]) : head(bytes.length, 0xd9, 1);
    return Buffer.concat([first, bytes]);
  }
  if (Buffer.isBuffer(value)) return Buffer.concat([head(value.length, 0xc4, 1), value]);
  const items = Array.isArray(value) ? value : Object.entries(value);
  const [fixed, wide] = Array.isArray(value) ? [0x90, 0xdc] : [0x80, 0xde];
  const first = items.length <= 15 ? Buffer.from([fixed | items.length]) : head(items.length, wide, 2);
  return Buffer.concat([first, ...items.flat().map(pack)]);
}

// `code` is that of the form whose length has `width` bytes; the next ones have twice as many.
function head(length, code, width) {
  if (length >= 256 ** width) return head(length, code + 1, 2 * width);
  const bytes = Buffer.alloc(1 + width, code);
  bytes.writeUIntBE(length, 1, width);
  return bytes;
}

function integer(value) {
  if (value >= -32n && value < 128n) return Buffer.from([Number(value) & 0xff]);
  const bits = [8, 16, 32, 64].find(n => (value < 0n ? BigInt.asIntN : BigInt.asUintN)(n, value) === value);
  const hex = BigInt.asUintN(bits, value).toString(16).padStart(bits / 4, '0');
  return Buffer.concat([Buffer.from([(value < 0n ? 0xd0 : 0xcc) + Math.log2(bits / 8)]), Buffer.from(hex, 'hex')]);
}
