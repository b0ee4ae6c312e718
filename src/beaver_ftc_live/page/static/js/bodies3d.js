// What aircraft are drawn of: boxes, colours, movable panels. x forward, y up, z right, metres.

import * as THREE from "../vendor/three.min.js";

export const HULL = 0xf0b429, WING = 0xf4f1e8, MOVING = 0x2b7fb8, BROKEN = 0xd1401f, DARK = 0x23303b;

export const paint = (color) => new THREE.MeshLambertMaterial({ color });

export function box(size, at, material) {
  const mesh = new THREE.Mesh(new THREE.BoxGeometry(...size), material);
  mesh.position.set(...at);
  return mesh;
}

// A movable panel: behind its hinge by its chord. axis: the hinge's; sign: of positive deflection; turned: rad,
// how the hinge lies.
export function panel(name, hinge, size, axis, sign, turned = [0, 0, 0]) {
  const place = new THREE.Group(), group = new THREE.Group();
  place.position.set(...hinge);
  place.rotation.set(...turned);
  const geometry = new THREE.BoxGeometry(...size);
  geometry.translate(-size[0] / 2, 0, 0);
  const mesh = new THREE.Mesh(geometry, paint(MOVING));
  mesh.userData.surface = name;
  group.add(mesh);
  const wanted = new THREE.LineSegments(new THREE.EdgesGeometry(geometry), new THREE.LineBasicMaterial({ color: 0x10212f }));
  place.add(group, wanted);
  return { name, place, group, mesh, wanted, axis, sign };
}
