// Entry of three.min.js: the parts of three.js that page.js uses.
// npx esbuild three_entry.js --bundle --minify --format=iife --global-name=THREE \
//   --legal-comments=inline --outfile=three.min.js
export {
  AmbientLight, BufferAttribute, BufferGeometry, Color, CylinderGeometry, DirectionalLight, DoubleSide, InstancedMesh,
  LineBasicMaterial, LineLoop, LineSegments, Mesh, MeshLambertMaterial, Object3D, OrthographicCamera,
  Plane, Scene, SphereGeometry, Vector3, WebGLRenderer,
} from "three";
export { OrbitControls } from "three/addons/controls/OrbitControls.js";
