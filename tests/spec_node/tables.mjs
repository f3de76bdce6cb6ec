// The tables of SPEC.md, read from SPEC.md itself: what a client's author would type from them.
// Written from SPEC.md alone, and must stay so: what it cannot know from there is SPEC.md's fault.
import { readFileSync } from 'node:fs';

const DEFAULTS = { undefined: null, empty: new Map(), '[]': [], False: false, 0: 0n };
const plain = cell => cell.replaceAll('`', '');

export function readSpec(path) {
  const spec = { envelope: null, bodies: {}, unions: {}, streams: new Map(), limits: {}, reasons: [] };
  const text = readFileSync(path, 'utf8');
  for (const { above, head, rows } of tables(text)) {
    if (head === 'topic,body,role,publisher,rate, Hz,policy,recorded')
      for (const [topic, body] of rows) spec.streams.set(plain(topic), /^\[(\w+)\]/.exec(body)[1]);
    if (head === 'what,limit') for (const [what, limit] of rows) spec.limits[what] = Number.parseInt(limit, 10);
    if (head === 'reason,meaning') spec.reasons = rows.map(([reason]) => plain(reason));
    if (head !== 'key,type,unit,,meaning') continue;
    const title = above.map(line => /^### (\w+)|^\*\*(\w+)\.\*\*/.exec(line)).findLast(Boolean);
    const name = title[1] ?? title[2];
    if (name === 'Envelope') spec.envelope = rows.map(field); else spec.bodies[name] = rows.map(field);
  }
  for (const section of text.split('\n### ')) {
    const kinds = /One of these maps; `kind` says which: (.*)\./.exec(section)?.[1].split(', ').map(plain);
    const of = kind => Object.keys(spec.bodies).find(name => isOf(spec.bodies[name][0], kind));
    if (kinds) spec.unions[/^\w+/.exec(section)[0]] = new Map(kinds.map(kind => [kind, of(kind)]));
  }
  return spec;
}

function isOf({ key, type }, kind) {
  return key === 'kind' && type.values?.length === 1 && type.values[0] === kind;
}

function tables(text) {
  const found = [];
  let above = [], rows = null;
  for (const line of text.split('\n')) {
    if (!line.startsWith('|')) {
      if (line) above = [...above.slice(-7), line];
      rows = null;
      continue;
    }
    const cells = line.split('|').slice(1, -1).map(cell => cell.trim());
    if (!rows) found.push({ above, head: cells.join(), rows: (rows = []) });
    else if (!cells.every(cell => /^-+$/.test(cell))) rows.push(cells);
  }
  return found;
}

function field([key, type, unit, need, meaning]) {
  const [, nil, otherwise] = /^required$|^may be (nil or )?absent(?:: (.*))?$/.exec(need) ?? unclear(need);
  if (!(otherwise in DEFAULTS)) unclear(otherwise);
  return {
    key: plain(key),
    type: typeOf(plain(type)),
    required: need === 'required',
    nilable: nil !== undefined,
    otherwise: DEFAULTS[otherwise],
    unitLength: unit === 'x, y, z, w' || unit === 'length 1',
    covariance: meaning.startsWith('xx, xy, xz, yy, yz, zz'),
  };
}

function typeOf(text) {
  let match;
  const literals = text.split(' or ');
  if (literals.every(each => /^(".*"|\d+)$/.test(each))) return { kind: 'literal', values: literals.map(JSON.parse) };
  if ((match = /^map of (.*)$/.exec(text))) return { kind: 'map of', of: typeOf(match[1]) };
  if ((match = /^array of (.*)$/.exec(text))) return { kind: 'array', of: typeOf(match[1]) };
  if ((match = /^map (\w+)$/.exec(text))) return { kind: 'body', name: match[1] };
  if ((match = /^float\[(\d)\]$/.exec(text))) return { kind: 'array', of: typeOf('float'), length: +match[1] };
  if ((match = /^(int|float)((?:,? (?:[<>]=?) [-\d.]+)*)$/.exec(text)))
    return { kind: match[1], bounds: [...match[2].matchAll(/([<>]=?) ([-\d.]+)/g)].map(([, op, to]) => [op, +to]) };
  return ['str', 'bool', 'bin', 'map'].includes(text) ? { kind: text } : unclear(text);
}

function unclear(what) {
  throw new Error(`SPEC.md: what is ${what}?`);
}
