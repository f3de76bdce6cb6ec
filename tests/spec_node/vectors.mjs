// Reads the golden vectors, `node vectors.mjs SPEC.md FOLDER`, and prints one line of JSON: how many, and what differs.
// Written from SPEC.md alone, and must stay so: what it cannot know from there is SPEC.md's fault.
import { readFileSync, readdirSync } from 'node:fs';
import { basename, join } from 'node:path';
import { Decoder } from './decoder.mjs';
import { Refused, pack } from './msgpack.mjs';
import { readSpec } from './tables.mjs';

const [specification, folder] = process.argv.slice(2);
const spec = readSpec(specification);
const decoder = new Decoder(spec);
const found = { valid: 0, invalid: 0, reasons: spec.reasons, differences: [] };

for (const file of readdirSync(folder, { recursive: true }).filter(name => name.endsWith('.json'))) {
  const { vectors } = JSON.parse(readFileSync(join(folder, file), 'utf8'));
  const refused = basename(file) === 'invalid.json';
  found[refused ? 'invalid' : 'valid'] += vectors.length;
  for (const vector of vectors) {
    const differences = refused ? refusal(vector) : understanding(vector);
    found.differences.push(...differences.map(what => `${vector.name}: ${what}`));
  }
}
console.log(JSON.stringify(found));

function understanding({ topic, topic_hex, payload_hex, payload_zeros = 0, canonical, message }) {
  const frames = [Buffer.from(topic_hex, 'hex'), Buffer.from(payload_hex + '00'.repeat(payload_zeros), 'hex')];
  const said = attempt(frames);
  if (said instanceof Refused) return [`refused, ${said.message}`];
  const differences = compare(said, message, 'message');
  if (frames[0].toString() !== topic) differences.push('another topic');
  if (pack(said).equals(frames[1]) !== canonical) differences.push(`canonical is not ${canonical}`);
  return differences;
}

function refusal({ frames_hex, last_frame_zeros = 0, reason }) {
  const frames = frames_hex.map((hex, i) => (i < frames_hex.length - 1 ? hex : hex + '00'.repeat(last_frame_zeros)));
  const said = attempt(frames.map(hex => Buffer.from(hex, 'hex')));
  if (!(said instanceof Refused)) return ['not refused'];
  return said.reason === reason ? [] : [`${said.message}, not ${reason}`];
}

function attempt(frames) {
  try {
    return decoder.decode(frames);
  } catch (error) {
    if (error instanceof Refused) return error;
    throw error;
  }
}

function compare(said, due, where) {
  if (typeof said === 'bigint') said = Number(said);
  if (Buffer.isBuffer(said)) said = said.toString('base64');
  const near = typeof due === 'number' && Math.abs(said - due) <= 1e-9 * Math.max(1, Math.abs(due));
  if (typeof said === 'number') return near ? [] : [`${where} is ${said}, not ${due}`];
  if (said === null || typeof said !== 'object') return said === due ? [] : [`${where} is ${said}, not ${due}`];
  if (Array.isArray(said) !== Array.isArray(due) || Object(due) !== due) return [`${where} is not ${due}`];
  const keys = new Set([...Object.keys(said), ...Object.keys(due)]);
  return [...keys].flatMap(key =>
    key in said && key in due ? compare(said[key], due[key], `${where}.${key}`) : [`${where}.${key} is on one side`],
  );
}
