// Messages of the wire: two frames to what they say. The types come from SPEC.md's tables, the rest is here.
// Written from SPEC.md alone, and must stay so: what it cannot know from there is SPEC.md's fault.
import { refuse, text, unpack } from './msgpack.mjs';

const USER = /^[a-z0-9][a-z0-9-]{0,31}$/;
const LEAST = -(2n ** 63n), MOST = 2n ** 63n - 1n;
const HOLDS = { '>=': (a, b) => a >= b, '<=': (a, b) => a <= b, '>': (a, b) => a > b, '<': (a, b) => a < b };

// Section 6, "What the tables cannot say"; the union of Calibration is in the tables' own words.
const RULES = {
  Imu: ({ gyro, q }) => gyro || q,
  HeadPose: ({ tracked, p, q }) => !tracked || (p && q),
  GaitEvent: ({ side, event }) => side || event === 'first_step' || event === 'stop',
  Session: ({ users }) => users.every(user => USER.test(user)),
};

export class Decoder {
  constructor(spec) {
    const { limits } = spec;
    this.spec = spec;
    this.most = {
      topic: limits.topic,
      payload: limits.payload,
      levels: limits['levels of arrays and maps, the envelope being the first'],
      elements: limits['elements of one array, pairs of one map'],
    };
    if (!Object.values(this.most).every(Number.isInteger)) throw new Error('SPEC.md: the limits are not clear');
  }

  decode(frames) {
    if (frames.length !== 2) refuse('frames', frames.length);
    const body = this.bodyOf(frames[0]);
    if (frames[1].length > this.most.payload) refuse('oversized', frames[1].length);
    const map = unpack(frames[1], this.most);
    const v = map instanceof Map ? map.get('v') : refuse('envelope', 'no map');
    if (typeof v !== 'bigint') refuse('envelope', 'v');
    if (v !== 1n) refuse('version', v);
    // `data` is the body's matter, which also refuses what is no map.
    const known = this.spec.envelope.map(field => (field.key === 'data' ? { ...field, type: { kind: 'any' } } : field));
    const message = this.fields(known, map, 'envelope', 'envelope');
    return { ...message, data: this.body(body, message.data, 'data') };
  }

  bodyOf(frame) {
    if (frame.length > this.most.topic) refuse('topic', 'too long');
    const topic = text(frame, 'topic');
    const [user] = topic.split('/', 1);
    const stream = topic.slice(user.length);
    if (user !== 'sys' && !USER.test(user)) refuse('topic', topic);
    return this.spec.streams.get((user === 'sys' ? user : '<user>') + stream) ?? refuse('topic', topic);
  }

  body(name, value, where) {
    if (!(value instanceof Map)) refuse('body', where);
    if (this.spec.unions[name]) name = this.spec.unions[name].get(value.get('kind')) ?? refuse('body', 'kind');
    const made = this.fields(this.spec.bodies[name], value, 'body', where);
    if (RULES[name] && !RULES[name](made)) refuse('body', `${name}'s own rule`);
    return made;
  }

  fields(fields, map, reason, where) {
    const made = {};
    for (const { key, type, required, nilable, otherwise, unitLength, covariance } of fields) {
      let value = map.get(key);
      if (value === undefined && required) refuse(reason, `${where}.${key} is missing`);
      if (value === undefined || (value === null && nilable)) value = otherwise;
      made[key] = value === null && nilable ? null : this.value(type, value, reason, `${where}.${key}`);
      if (unitLength && made[key]) made[key] = normalised(made[key], `${where}.${key}`);
      if (covariance) checkCovariance(made[key], `${where}.${key}`);
    }
    return made;
  }

  value(type, value, reason, where) {
    const due = what => what || refuse(reason, where);
    switch (type.kind) {
      case 'int':
      case 'float':
        return number(type, value, reason, where);
      case 'literal':
        due(type.values.some(each => each === value || (typeof each === 'number' && BigInt(each) === value)));
        return value;
      case 'str':
        due(typeof value === 'string');
        return value;
      case 'bool':
        due(typeof value === 'boolean');
        return value;
      case 'bin':
        due(Buffer.isBuffer(value));
        return value;
      case 'array':
        due(Array.isArray(value) && value.length === (type.length ?? value.length));
        return value.map((each, i) => this.value(type.of, each, reason, `${where}[${i}]`));
      case 'map of': {
        due(value instanceof Map && [...value.keys()].every(key => typeof key === 'string'));
        const read = ([key, each]) => [key, this.value(type.of, each, reason, `${where}.${key}`)];
        return Object.fromEntries([...value].map(read));
      }
      case 'body':
        return this.body(type.name, value, where);
      case 'any':
        return value;
    }
    throw new Error(`SPEC.md: what is ${type.kind}?`);
  }
}

function number({ kind, bounds }, value, reason, where) {
  if (typeof value === 'number' && !Number.isFinite(value)) refuse(reason === 'body' ? 'not_finite' : reason, where);
  if (kind === 'float' && typeof value === 'bigint') value = Number(value);
  if (typeof value !== (kind === 'int' ? 'bigint' : 'number')) refuse(reason, where);
  if (kind === 'int' && (value < LEAST || value > MOST)) refuse(reason, where);
  if (!bounds.every(([op, to]) => HOLDS[op](value, to))) refuse(reason, `${where} is ${value}`);
  return value;
}

function normalised(vector, where) {
  const length = Math.hypot(...vector);
  if (!(Math.abs(length - 1) <= 0.001)) refuse('body', `${where} has the length ${length}`);
  return vector.map(x => x / length);
}

function checkCovariance(elements, where) {
  const most = Math.max(...elements.map(Math.abs));
  if (most === 0) return;
  const [xx, xy, xz, yy, yz, zz] = elements.map(element => element / most);
  const minors = [xx * yy - xy * xy, xx * zz - xz * xz, yy * zz - yz * yz];
  minors.push(xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz));
  if (Math.min(xx, yy, zz) < 0 || Math.min(...minors) < -1e-9) refuse('body', `${where} is not semidefinite`);
}
