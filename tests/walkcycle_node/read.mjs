// Reads a BVH or GLB as three.js does and prints the world places of its joints at given times as JSON;
// for a GLB, the findings of Khronos's validator too.
//   node read.mjs FILE TIME...
import { readFileSync } from 'node:fs';

globalThis.self = globalThis;
const THREE = await import('three');
const { BVHLoader } = await import('three/addons/loaders/BVHLoader.js');
const { GLTFLoader } = await import('three/addons/loaders/GLTFLoader.js');

const [file, ...words] = process.argv.slice(2);
const times = words.map(Number);
const bytes = readFileSync(file);
const found = { places: [] };

let root, clip;
if (file.endsWith('.bvh')) {
  const read = new BVHLoader().parse(bytes.toString('utf8'));
  root = read.skeleton.bones[0];
  clip = read.clip;
} else {
  const buffer = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length);
  const read = await new Promise((done, failed) => new GLTFLoader().parse(buffer, '', done, failed));
  root = read.scene;
  clip = read.animations[0];
  const { default: validator } = await import('gltf-validator');
  const report = await validator.validateBytes(new Uint8Array(bytes));
  found.issues = report.issues;
  found.skinned = [];
  root.traverse((node) => { if (node.isSkinnedMesh) found.skinned.push(node.skeleton.bones.length); });
}

found.duration = clip.duration;
const mixer = new THREE.AnimationMixer(root);
const action = mixer.clipAction(clip);
action.setLoop(THREE.LoopOnce);
action.clampWhenFinished = true;
action.play();
for (const time of times) {
  mixer.setTime(time);
  root.updateMatrixWorld(true);
  const places = {};
  root.traverse((node) => {
    if (node.isBone && node.name && node.name !== 'ENDSITE') {
      places[node.name] = new THREE.Vector3().setFromMatrixPosition(node.matrixWorld).toArray();
    }
  });
  found.places.push(places);
}
console.log(JSON.stringify(found));
