// The aircraft in its air: chase camera, ground, clouds to pass by, the path flown.

import * as THREE from "../vendor/three.min.js";
import { buildAircraft, deflect, dismember } from "./aircraft3d.js";
import { damages, flight, value } from "./state.js";

const PATH_POINTS = 600, PATH_STEP_S = 0.25, CLOUDS = 36, CLOUD_BOX_M = 700;
const CAMERAS = [[-21, 6.5, 8], [-13, 12, 0.01], [5, 2.5, 19], [-8, -3, -17]];

export class View {
  constructor(canvas, choose) {
    this.canvas = canvas;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: false, powerPreference: "low-power" });
    this.sharpness = 1;
    this.scene = new THREE.Scene();
    this.scene.background = new THREE.Color(0x9cc9e6);
    this.scene.fog = new THREE.Fog(0x9cc9e6, 900, 9000);
    this.camera = new THREE.PerspectiveCamera(42, 1, 0.5, 12000);
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0x667755, 2.2), this.sun());
    this.addGround();
    this.addClouds();
    this.addPath();
    this.pose = { yaw: 0, camera: 0 };
    this.ray = new THREE.Raycaster();
    canvas.addEventListener("click", (event) => this.click(event, choose));
    new ResizeObserver(() => this.resize()).observe(canvas);
  }

  sun() {
    const light = new THREE.DirectionalLight(0xffffff, 1.6);
    light.position.set(-300, 600, 200);
    return light;
  }

  addGround() {
    this.ground = new THREE.Mesh(new THREE.PlaneGeometry(24000, 24000), new THREE.MeshBasicMaterial({ color: 0x6d8f5e }));
    this.ground.rotation.x = -Math.PI / 2;
    this.grid = new THREE.GridHelper(20000, 80, 0x41603a, 0x557a4c);
    this.scene.add(this.ground, this.grid);
  }

  addClouds() {
    const shape = new THREE.SphereGeometry(9, 8, 6), white = new THREE.MeshLambertMaterial({ color: 0xffffff, transparent: true, opacity: 0.8 });
    this.clouds = Array.from({ length: CLOUDS }, (_, i) => {
      const cloud = new THREE.Mesh(shape, white);
      cloud.scale.set(1 + (i % 3), 0.35, 1 + (i % 4) * 0.5);
      cloud.userData.home = [0.755, 0.569, 0.339].map((step) => ((i + 1) * step % 1 - 0.5) * CLOUD_BOX_M);
      this.scene.add(cloud);
      return cloud;
    });
  }

  addPath() {
    this.points = new Float32Array(PATH_POINTS * 3);
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(this.points, 3));
    this.path = new THREE.Line(geometry, new THREE.LineBasicMaterial({ color: 0xb03a1a }));
    this.path.frustumCulled = false;
    this.scene.add(this.path);
    this.forgetPath();
  }

  forgetPath() {
    this.pathCount = 0;
    this.pathFrom = -Infinity;
    this.path.geometry.setDrawRange(0, 0);
  }

  meet(hello) {
    if (this.aircraft) this.scene.remove(this.aircraft.root);
    this.aircraft = buildAircraft(hello.surfaces);
    this.scene.add(this.aircraft.root);
    this.forgetPath();
    this.pose.yaw = null;
    this.resize();
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (!width || !height) return;
    this.renderer.setPixelRatio(this.sharpness);
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
  }

  // A machine without a graphics card draws fewer pixels rather than fewer frames.
  soften() {
    if (this.sharpness <= 0.5) return;
    this.sharpness -= 0.25;
    this.resize();
  }

  nextCamera() {
    this.pose.camera = (this.pose.camera + 1) % CAMERAS.length;
  }

  draw() {
    if (!this.aircraft || !flight.frame) return;
    const root = this.aircraft.root, broken = new Set(flight.state?.broken ?? []);
    root.position.set(value("north_m"), value("altitude_m"), value("east_m"));
    const psi = value("psi_rad");
    root.rotation.set(value("phi_rad"), -psi, value("theta_rad"), "YZX");
    deflect(this.aircraft.panels, (s) => value(`${s}_cmd_rad`), (s) => value(`${s}_effective_rad`), broken);
    dismember(this.aircraft, damages(), flight.hello.damage);
    this.moveAir(root.position);
    this.extendPath(root.position);
    this.follow(root.position, psi);
    this.renderer.render(this.scene, this.camera);
  }

  moveAir({ x, y, z }) {
    this.ground.position.set(x, -1, z);
    this.grid.position.set(Math.round(x / 250) * 250, 0, Math.round(z / 250) * 250);
    const wrap = (home, at) => at + ((((home - at) % CLOUD_BOX_M) + 1.5 * CLOUD_BOX_M) % CLOUD_BOX_M) - CLOUD_BOX_M / 2;
    for (const cloud of this.clouds) {
      const [north, up, east] = cloud.userData.home;
      cloud.position.set(wrap(north, x), wrap(up * 0.6 - 120, y), wrap(east, z));
    }
  }

  extendPath(at) {
    const t = value("t_s");
    if (t < this.pathFrom) this.forgetPath();
    if (t - this.pathFrom < PATH_STEP_S) return;
    this.pathFrom = t;
    if (this.pathCount === PATH_POINTS) {
      this.points.copyWithin(0, 3);
      this.pathCount -= 1;
    }
    this.points.set([at.x, at.y, at.z], 3 * this.pathCount);
    this.pathCount += 1;
    this.path.geometry.attributes.position.needsUpdate = true;
    this.path.geometry.setDrawRange(0, this.pathCount);
  }

  // The camera stays level and turns with the heading, slowly: so that attitude is seen.
  follow({ x, y, z }, psi) {
    const pose = this.pose;
    const turn = pose.yaw === null ? 1 : 0.06;
    pose.yaw = (pose.yaw ?? psi) + turn * Math.atan2(Math.sin(psi - (pose.yaw ?? psi)), Math.cos(psi - (pose.yaw ?? psi)));
    const [ahead, up, right] = CAMERAS[pose.camera], c = Math.cos(pose.yaw), s = Math.sin(pose.yaw);
    const far = Math.max(1, 1.25 / this.camera.aspect);
    this.camera.position.set(x + far * (ahead * c - right * s), y + far * up, z + far * (ahead * s + right * c));
    this.camera.lookAt(x, y, z);
  }

  click(event, choose) {
    if (!this.aircraft) return;
    const frame = this.canvas.getBoundingClientRect();
    const at = new THREE.Vector2(((event.clientX - frame.left) / frame.width) * 2 - 1, 1 - ((event.clientY - frame.top) / frame.height) * 2);
    this.ray.setFromCamera(at, this.camera);
    const hit = this.ray.intersectObjects(this.aircraft.panels.map(({ mesh }) => mesh))[0];
    choose(hit ? hit.object.userData.surface : this.nearest(at), event.clientX, event.clientY);
  }

  // The surface nearest to a click that missed by a finger's width, or null.
  nearest(at) {
    let best = null, least = 0.08;
    for (const { name, mesh } of this.aircraft.panels) {
      const centre = new THREE.Vector3();
      mesh.geometry.computeBoundingBox();
      mesh.geometry.boundingBox.getCenter(centre);
      mesh.localToWorld(centre).project(this.camera);
      const off = Math.hypot((centre.x - at.x) * this.camera.aspect, centre.y - at.y);
      if (off < least) [best, least] = [name, off];
    }
    return best;
  }
}
