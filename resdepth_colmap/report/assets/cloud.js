// The fused cloud in 3D, before and after, by three.js. Drawn when something changes.

const TURN = 0.08; // radians a key press
const ZOOM = 1.12;
const MOVE = 0.25; // page units
const POINT_SIZE = 0.5; // of the points' spacing, for each step of the slider

const CLOUD_HINT =
  "Drag to turn, two fingers or the right button to move, wheel or pinch to zoom after a click. " +
  "Keys: arrows turn, shift + arrows move, + and − zoom, B switches, Home resets.";

async function startCloud() {
  const facts = report.cloud;
  if (!facts || !Object.keys(facts.clouds).length) {
    const why = report.summary.fuse_error ? "" : " Run resdepth-colmap fuse, then resdepth-colmap report.";
    cloudFails(`There is no fused.ply to show.${why}`);
    return;
  }
  let viewer;
  try {
    viewer = new CloudViewer(byId("cloud-canvas"), facts);
  } catch {
    cloudFails("This browser has no WebGL, so the cloud cannot be shown here; open fused.ply instead.");
    return;
  }
  const names = ["before", "after"].filter((name) => name in facts.clouds);
  const words = { before: "Initial", after: "Refined" };
  const choose = (name) => viewer.show(name).catch((error) => cloudFails(`The cloud cannot be shown (${error.message}).`));
  segments(byId("cloud-choice"), names.map((name) => [name, words[name]]), "after", choose);
  byId("show-cameras").addEventListener("change", (event) => viewer.showCameras(event.target.checked));
  byId("point-size").addEventListener("input", (event) => viewer.setPointSize(event.target.value));
  byId("reset-look").addEventListener("click", () => viewer.reset());
  await choose("after");
}

function cloudFails(text) {
  const message = byId("cloud-message");
  message.hidden = false;
  message.textContent = text;
  byId("cloud-canvas").hidden = true;
  byId("cloud-controls").hidden = true;
  byId("cloud-hint").hidden = true;
}

class CloudViewer {
  constructor(canvas, facts) {
    this.canvas = canvas;
    this.facts = facts;
    this.clouds = new Map();
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true });
    this.renderer.setClearColor(0x0d0f13);
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(facts.look.fov_deg, 1, 0.01, 200);
    this.camera.up.set(...facts.look.up).normalize();
    this.controls = new THREE.OrbitControls(this.camera, canvas);
    this.controls.enableZoom = false; // until the canvas is clicked: the page scrolls
    this.controls.zoomToCursor = true;
    this.controls.addEventListener("change", () => this.draw());
    this.material = new THREE.PointsMaterial({ vertexColors: true, sizeAttenuation: true });
    this.cameras = this.outlines();
    this.scene.add(this.cameras);
    this.listen();
    this.setPointSize(byId("point-size").value);
    this.reset();
    this.resize();
  }

  listen() {
    const zooms = (is) => () => (this.controls.enableZoom = is);
    this.canvas.addEventListener("pointerdown", zooms(true));
    this.canvas.addEventListener("focus", zooms(true));
    this.canvas.addEventListener("blur", zooms(false));
    this.canvas.addEventListener("pointerdown", () => this.canvas.focus({ preventScroll: true }));
    this.canvas.addEventListener("keydown", (event) => this.onKey(event));
    new ResizeObserver(() => this.resize()).observe(this.canvas);
  }

  async show(name) {
    if (!this.clouds.has(name)) this.clouds.set(name, await this.load(name));
    for (const [other, points] of this.clouds) points.visible = other === name;
    const shown = this.facts.clouds[name].shown;
    byId("cloud-hint").textContent = `${count(shown)} points are shown. ${CLOUD_HINT}`;
    this.draw();
  }

  async load(name) {
    const png = await decodePng(blockBytes(`cloud-${name}-points`));
    const colors = await decodePng(blockBytes(`cloud-${name}-colors`));
    const values = joinedPlanes(png);
    const number = png.width;
    const positions = new Float32Array(3 * number);
    for (let axis = 0; axis < 3; axis++) {
      for (let i = 0; i < number; i++) positions[3 * i + axis] = (values[axis * number + i] / 65535 - 0.5) * this.facts.size;
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(positions, 3));
    geometry.setAttribute("color", new THREE.BufferAttribute(linearColors(colors.values), 3));
    const points = new THREE.Points(geometry, this.material);
    points.frustumCulled = false;
    this.scene.add(points);
    return points;
  }

  // Each camera is a pyramid: an apex and four corners.
  outlines() {
    const edges = [[0, 1], [0, 2], [0, 3], [0, 4], [1, 2], [2, 3], [3, 4], [4, 1]];
    const positions = this.facts.cameras.flatMap((outline) => edges.flatMap(([a, b]) => [...outline[a], ...outline[b]]));
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(positions), 3));
    const material = new THREE.LineBasicMaterial({ color: 0x35c9bd, transparent: true, opacity: 0.7 });
    return new THREE.LineSegments(geometry, material);
  }

  showCameras(are) {
    this.cameras.visible = are;
    this.draw();
  }

  setPointSize(value) {
    this.material.size = value * POINT_SIZE * this.facts.spacing;
    this.draw();
  }

  reset() {
    const { eye, target } = this.facts.look;
    this.camera.position.set(...eye);
    this.controls.target.set(...target);
    this.controls.update();
    this.draw();
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (!width || !height) return;
    this.renderer.setPixelRatio(Math.min(2, window.devicePixelRatio));
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    // Narrow pictures show as much in width as the first look was chosen for.
    const { fov_deg: fov, aspect } = this.facts.look;
    const wider = Math.max(1, aspect / this.camera.aspect);
    this.camera.fov = (360 / Math.PI) * Math.atan(wider * Math.tan((fov * Math.PI) / 360));
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  draw() {
    if (this.isDue) return;
    this.isDue = true;
    requestAnimationFrame(() => {
      this.isDue = false;
      this.renderer.render(this.scene, this.camera);
    });
  }

  onKey(event) {
    const { key } = event;
    if (key in ARROWS) this.turnOrMove(...ARROWS[key], event.shiftKey);
    else if (key === "+" || key === "=") this.zoom(1 / ZOOM);
    else if (key === "-") this.zoom(ZOOM);
    else if (key === "Home") this.reset();
    else if (key === "b" || key === "B") byId("cloud-choice").querySelector("input:not(:checked)")?.click();
    else return;
    event.preventDefault();
  }

  turnOrMove(x, y, isMove) {
    const offset = this.camera.position.clone().sub(this.controls.target);
    const right = new THREE.Vector3().crossVectors(this.camera.up, offset).normalize();
    if (isMove) {
      const step = right.multiplyScalar(MOVE * x).addScaledVector(this.camera.up, -MOVE * y);
      this.camera.position.add(step);
      this.controls.target.add(step);
    } else {
      offset.applyAxisAngle(this.camera.up, -TURN * x);
      offset.applyAxisAngle(right, -TURN * y);
      this.camera.position.copy(this.controls.target).add(offset);
    }
    this.controls.update();
    this.draw();
  }

  zoom(factor) {
    const offset = this.camera.position.clone().sub(this.controls.target);
    this.camera.position.copy(this.controls.target).addScaledVector(offset, factor);
    this.controls.update();
    this.draw();
  }
}

// Photos are sRGB, three.js works in linear light.
function linearColors(values) {
  const table = Float32Array.from({ length: 256 }, (_, i) => {
    const v = i / 255;
    return v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
  });
  return Float32Array.from(values, (value) => table[value]);
}
