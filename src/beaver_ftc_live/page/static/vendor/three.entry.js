// What the page uses of three.js; see README.md.
export {
  AmbientLight, BoxGeometry, BufferAttribute, BufferGeometry, CapsuleGeometry, CircleGeometry, Color,
  CylinderGeometry, DirectionalLight, DoubleSide, EdgesGeometry, Euler, ExtrudeGeometry, Fog, GridHelper,
  Group, HemisphereLight, LatheGeometry, Line, LineBasicMaterial, LineSegments, Matrix4, Mesh,
  MeshBasicMaterial, MeshLambertMaterial, PerspectiveCamera, PlaneGeometry, Quaternion, Raycaster, Scene,
  Shape, SphereGeometry, Vector2, Vector3, WebGLRenderer,
} from "three";
