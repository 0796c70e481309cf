// The page: draws what the server sends, and sends what hand and panel ask for.
import * as T from './three.min.js';

const make = (tag, set = {}, ...inside) => {
  const e = Object.assign(document.createElement(tag), set);
  e.append(...inside);
  return e;
};
const at = id => document.getElementById(id);
const words = x => x == null ? '–' : x == 0 ? '0' : Math.abs(x) < 1e-2 || Math.abs(x) >= 1e5 ? x.toExponential(2) : String(+x.toPrecision(3));

// what tests and the curious may look at
const W = window.tisoft = { drawn: 0, received: 0, number: 0, status: {}, level: 0, time: 0, connected: false };

const ask = new URLSearchParams(location.search);
const canvas = at('view');
const renderer = new T.WebGLRenderer({ canvas, antialias: ask.get('plain') == null });
const scene = new T.Scene();
scene.background = new T.Color(0xdfe6ec);
const camera = new T.PerspectiveCamera(40, 1, 0.01, 100);
const orbit = new T.OrbitControls(camera, canvas);
W.camera = camera;
scene.add(new T.HemisphereLight(0xffffff, 0xb9b2a4, 1.6));
const sun = new T.DirectionalLight(0xfff4e0, 2.2);
sun.castShadow = true;
sun.shadow.mapSize.set(1024, 1024);
renderer.shadowMap.enabled = true;
scene.add(sun, sun.target);

// -- the bodies -----------------------------------------------------------------------------------
let info = null, mesh, lines, size = 1, middle = new T.Vector3(), newest = null, dirty = true;
let place, normal, paint, linePlace, linePaint, map, plain, regions, culprit, things = [];

const linear = c => { c /= 255; return c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4; };
const moving = n => new T.BufferAttribute(new Float32Array(n), 3).setUsage(T.DynamicDrawUsage);

function build(hello) {
  info = hello;
  info.vertices = Uint32Array.from(info.vertices);
  info.triangles = Uint32Array.from(info.triangles);
  info.segments = Uint32Array.from(info.segments);
  map = Float32Array.from(info.map, linear);
  plain = Float32Array.from(info.plain, linear);
  regions = Float32Array.from(info.regions, linear);
  const g = new T.BufferGeometry(), l = new T.BufferGeometry();
  [place, normal, paint] = [0, 1, 2].map(() => moving(3 * info.vertices.length));
  [linePlace, linePaint] = [0, 1].map(() => moving(3 * info.segments.length));
  g.setAttribute('position', place); g.setAttribute('normal', normal); g.setAttribute('color', paint);
  g.setIndex(new T.BufferAttribute(info.triangles, 1));
  l.setAttribute('position', linePlace); l.setAttribute('color', linePaint);
  mesh = new T.Mesh(g, new T.MeshStandardMaterial({ vertexColors: true, roughness: 0.55, side: T.DoubleSide }));
  mesh.castShadow = mesh.receiveShadow = true;
  lines = new T.LineSegments(l, new T.LineBasicMaterial({ vertexColors: true }));
  mesh.frustumCulled = lines.frustumCulled = false;
  scene.add(mesh, lines);
  const lo = new T.Vector3(...info.lo), hi = new T.Vector3(...info.hi);
  middle = lo.clone().add(hi).multiplyScalar(0.5);
  size = Math.max(hi.distanceTo(lo), 1e-9);
  const up = new T.Vector3(...info.down).negate();
  camera.up.copy(up);
  things = info.obstacles.map((o, i) => {       // each in a frame of its own, which moves
    const frame = new T.Group(), m = obstacle(o);
    m.userData.number = i;
    frame.add(m);
    scene.add(frame);
    return frame;
  });
  culprit = new T.LineSegments(new T.BufferGeometry().setAttribute('position', moving(72)), new T.LineBasicMaterial({ color: 0xd4145a, depthTest: false, transparent: true }));
  culprit.frustumCulled = false; culprit.renderOrder = 2;
  scene.add(culprit);
  scene.fog = new T.Fog(0xdfe6ec, 4 * size, 14 * size);
  const side = Math.abs(up.z) > 0.9 ? new T.Vector3(0.45, -1.25, 0) : new T.Vector3(0.45, 0, 1.25);
  sun.position.copy(middle).addScaledVector(up, 1.6 * size).addScaledVector(side, 0.8 * size);
  sun.target.position.copy(middle);
  Object.assign(sun.shadow.camera, { left: -1.6 * size, right: 1.6 * size, top: 1.6 * size, bottom: -1.6 * size, near: 0.1 * size, far: 5 * size });
  sun.shadow.bias = -0.0006; sun.shadow.normalBias = 0.01 * size;
  W.frame = () => {
    orbit.target.copy(middle);
    const far = 1.55 * size * Math.max(1, 0.9 * innerHeight / innerWidth);
    camera.position.copy(middle).addScaledVector(side, far).addScaledVector(up, 0.35 * far);
    camera.near = 0.01 * size; camera.far = 60 * size;
    camera.updateProjectionMatrix(); orbit.update(); dirty = true;
  };
  orbit.object.up.copy(up);
  W.frame();
  panel();
}

function obstacle(o) {
  const stuff = new T.MeshStandardMaterial({ color: 0xc9cdd2, roughness: 0.9 });
  let m;
  if (o.kind == 'plane') {
    m = new T.Mesh(new T.PlaneGeometry(40 * size, 40 * size), stuff);
    const n = new T.Vector3(...o.normal).normalize();
    m.quaternion.setFromUnitVectors(new T.Vector3(0, 0, 1), n);
    const p = new T.Vector3(...o.point);
    m.position.copy(middle).addScaledVector(n, p.sub(middle).dot(n));
    const k = make('canvas', { width: 64, height: 64 }), d = k.getContext('2d');
    d.fillStyle = '#d8dce0'; d.fillRect(0, 0, 64, 64);
    d.fillStyle = '#cdd2d8'; d.fillRect(0, 0, 32, 32); d.fillRect(32, 32, 32, 32);
    const t = new T.CanvasTexture(k);
    t.wrapS = t.wrapT = T.RepeatWrapping; t.repeat.set(80, 80); t.colorSpace = T.SRGBColorSpace; t.anisotropy = 8;
    stuff.map = t; stuff.color.set(0xffffff);
  } else if (o.kind == 'sphere') {
    m = new T.Mesh(new T.SphereGeometry(o.radius, 48, 24), stuff); m.position.set(...o.center);
  } else {
    const g = new T.BufferGeometry();
    g.setAttribute('position', new T.BufferAttribute(Float32Array.from(o.points), 3));
    g.setIndex(o.triangles);
    g.computeVertexNormals();
    m = new T.Mesh(g, stuff);
  }
  m.receiveShadow = true;
  return m;
}

function show(buffer) {                     // the newest picture into the GPU's arrays
  const head = new DataView(buffer), n = info.rows, m = info.extra;
  const more = new Float32Array(buffer, 20, m), p = new Float32Array(buffer, 20 + 4 * m, 3 * n), v = new Uint8Array(buffer, 20 + 4 * m + 12 * n, n);
  const kind = info.colors[head.getUint32(16, true)], own = { body: plain, region: regions }[kind];
  const fill = (rows, P, C) => {
    for (let i = 0; i < rows.length; i++) {
      const j = 3 * rows[i], c = own ? j : 3 * v[rows[i]], from = own || map;
      P[3 * i] = p[j]; P[3 * i + 1] = p[j + 1]; P[3 * i + 2] = p[j + 2];
      C[3 * i] = from[c]; C[3 * i + 1] = from[c + 1]; C[3 * i + 2] = from[c + 2];
    }
  };
  things.forEach((frame, i) => {
    frame.position.set(...more.subarray(7 * i, 7 * i + 3));
    frame.quaternion.set(...more.subarray(7 * i + 3, 7 * i + 7));
  });
  const marks = more.subarray(m - 72), count = marks.findIndex(Number.isNaN);
  culprit.geometry.attributes.position.array.set(marks.map(x => x || 0));
  culprit.geometry.attributes.position.needsUpdate = true;
  culprit.geometry.setDrawRange(0, count < 0 ? 24 : count / 3);
  W.marks = count < 0 ? 24 : count / 3;
  W.more = more; W.color = kind;
  fill(info.vertices, place.array, paint.array);
  fill(info.segments, linePlace.array, linePaint.array);
  const P = place.array, N = normal.array, tri = info.triangles;
  N.fill(0);
  for (let t = 0; t < tri.length; t += 3) {
    const a = 3 * tri[t], b = 3 * tri[t + 1], c = 3 * tri[t + 2];
    const ux = P[b] - P[a], uy = P[b + 1] - P[a + 1], uz = P[b + 2] - P[a + 2], wx = P[c] - P[a], wy = P[c + 1] - P[a + 1], wz = P[c + 2] - P[a + 2];
    const x = uy * wz - uz * wy, y = uz * wx - ux * wz, z = ux * wy - uy * wx;
    N[a] += x; N[a + 1] += y; N[a + 2] += z; N[b] += x; N[b + 1] += y; N[b + 2] += z; N[c] += x; N[c + 1] += y; N[c + 2] += z;
  }
  for (let i = 0; i < N.length; i += 3) {
    const s = 1 / (Math.hypot(N[i], N[i + 1], N[i + 2]) || 1);
    N[i] *= s; N[i + 1] *= s; N[i + 2] *= s;
  }
  for (const b of [place, normal, paint, linePlace, linePaint]) b.needsUpdate = true;
  W.number = head.getUint32(0, true); W.drag = head.getUint32(4, true);
  W.time = head.getFloat32(8, true); W.top = head.getFloat32(12, true);
  W.positions = p; dirty = true;
  plot.add(W.time, more.subarray(7 * things.length, m - 72));
}

// -- probes: how they went in the last seconds --------------------------------------------------------
const plot = {
  rows: [], box: null, ways: ['moved', 'x', 'y', 'z'], way: 'moved',
  add(time, places) {
    if (!this.box) return;
    if (this.rows.length && time <= this.rows.at(-1).time) { if (time == this.rows.at(-1).time) return; this.rows = []; }
    this.rows.push({ time, places: places.slice() });
    while (this.rows.length > 2 && (this.rows[0].time < time - 10 || this.rows.length > 1500)) this.rows.shift();
    this.late = true;
  },
  value(row, k) {
    const x = row.places, at = this.ways.indexOf(this.way) - 1;
    if (at >= 0) return x[3 * k + at];
    const o = info.places || (info.places = this.rows[0].places);
    return Math.hypot(x[3 * k] - o[3 * k], x[3 * k + 1] - o[3 * k + 1], x[3 * k + 2] - o[3 * k + 2]);
  },
  color: k => `rgb(${[[200, 70, 50], [40, 110, 190], [30, 140, 110], [150, 90, 160], [90, 100, 120]][k % 5]})`,
  draw() {
    if (!this.box || !this.late || this.rows.length < 2) return;
    this.late = false;
    const d = this.box.getContext('2d'), w = this.box.width, h = this.box.height, rows = this.rows;
    let lo = Infinity, hi = -Infinity;
    const lines = info.probes.map((_, k) => rows.map(r => { const y = this.value(r, k); lo = Math.min(lo, y); hi = Math.max(hi, y); return y; }));
    if (!(hi - lo > 1e-9 * size)) { hi += 1e-6 * size; lo -= 1e-6 * size; }
    const x = t => w * (t - rows[0].time) / Math.max(rows.at(-1).time - rows[0].time, 1e-9), y = v => 3 + (h - 6) * (hi - v) / (hi - lo);
    d.clearRect(0, 0, w, h);
    d.lineWidth = 2.5;
    lines.forEach((line, k) => {
      d.strokeStyle = this.color(k);
      d.beginPath();
      line.forEach((v, i) => d.lineTo(x(rows[i].time), y(v)));
      d.stroke();
    });
    at('plot-lo').textContent = `${words(lo)} m`; at('plot-hi').textContent = `${words(hi)} m`;
    W.plotted = [lo, hi, rows.length];
  },
};

// -- the hand: a press on the body pulls it, with Shift carries pins and obstacles; elsewhere the view turns
const ray = new T.Raycaster(), facing = new T.Plane(), mouse = new T.Vector2(), hit = new T.Vector3();
const thread = new T.Line(new T.BufferGeometry().setAttribute('position', moving(6)), new T.LineBasicMaterial({ color: 0x1560bd, depthTest: false }));
const knob = new T.Mesh(new T.SphereGeometry(1, 20, 12), new T.MeshLambertMaterial({ color: 0x1560bd }));
thread.frustumCulled = false; thread.visible = knob.visible = false;
scene.add(thread, knob);
let held = null, finger = null, wanted = false, orders = 0;
const aim = e => { mouse.set(2 * e.clientX / innerWidth - 1, 1 - 2 * e.clientY / innerHeight); ray.setFromCamera(mouse, camera); };
const send = order => { if (socket && socket.readyState == 1) socket.send(JSON.stringify(order)); };
W.held = () => held;
W.target = hit;

function pressed() {                       // {rows, weights, point} under the pointer, or null
  mesh.geometry.boundingSphere = mesh.geometry.boundingBox = null;
  const found = info.triangles.length ? ray.intersectObject(mesh)[0] : null;
  if (found) {
    const f = [found.face.a, found.face.b, found.face.c];
    const w = T.Triangle.getBarycoord(found.point, ...f.map(i => new T.Vector3().fromBufferAttribute(place, i)), new T.Vector3());
    return w && { rows: f.map(i => info.vertices[i]), weights: w.toArray(), point: found.point.clone() };
  }
  let best = null, least = 14;               // a spring's end within so many pixels
  const q = new T.Vector3();
  for (let i = 0; i < info.segments.length; i++) {
    q.fromBufferAttribute(linePlace, i).project(camera);
    const away = Math.hypot((q.x - mouse.x) * innerWidth / 2, (q.y - mouse.y) * innerHeight / 2);
    if (away < least && Math.abs(q.z) < 1) { least = away; best = i; }
  }
  return best == null ? null : { rows: [info.segments[best]], weights: [1], point: new T.Vector3().fromBufferAttribute(linePlace, best) };
}

function reached() {                       // {obstacle, point} under the pointer, where the body is not before it
  const found = ray.intersectObjects(things, true)[0];
  return found && { obstacle: found.object.userData.number, point: found.point.clone(), far: found.distance };
}
canvas.addEventListener('pointerdown', e => {
  at('panel').contains(document.activeElement) && document.activeElement.blur();
  if (e.button != 0 || !W.positions || held || e.altKey || !W.connected) return;
  aim(e);
  let found = pressed(), kind = 'grab';
  if (e.shiftKey) {
    const thing = reached();
    kind = 'pin';
    if (thing && !(found && ray.ray.origin.distanceTo(found.point) < thing.far)) { found = thing; kind = 'obstacle'; }
  }
  if (!found) return;
  held = found; finger = e.pointerId;
  facing.setFromNormalAndCoplanarPoint(camera.getWorldDirection(new T.Vector3()), found.point);
  hit.copy(found.point);
  orbit.enabled = false;
  canvas.setPointerCapture(e.pointerId);
  e.stopImmediatePropagation();
  const what = kind == 'obstacle' ? { obstacle: held.obstacle } : { rows: held.rows, weights: held.weights };
  send({ do: kind, ...what, point: hit.toArray(), number: ++orders });
  dirty = true;
}, true);
canvas.addEventListener('pointermove', e => {
  if (!held || e.pointerId != finger) return;
  aim(e);
  if (ray.ray.intersectPlane(facing, hit)) wanted = dirty = true;
}, true);
const drop = () => {
  if (!held) return;
  held = finger = null; wanted = false; orbit.enabled = true;
  send({ do: 'drop' });
  dirty = true;
};
for (const what of ['pointerup', 'pointercancel']) canvas.addEventListener(what, e => { if (e.pointerId == finger) drop(); }, true);
addEventListener('blur', drop);
canvas.addEventListener('contextmenu', e => e.preventDefault());

// -- keys and panel -----------------------------------------------------------------------------------
const KEYS = [
  ['Space', 'pause, go on', [' '], () => send({ do: 'pause', on: !W.status.paused })],
  ['→ N', 'one frame', ['ArrowRight', 'n', 'N'], () => send({ do: 'step' })],
  ['Backspace', 'reset', ['Backspace'], () => send({ do: 'reset' })],
  ['U', 'undo the last change of a number', ['u', 'U'], () => send({ do: 'undo' })],
  ['V', 'record, end the recording', ['v', 'V'], () => record()],
  ['F Home', 'frame the view', ['f', 'F', 'Home'], () => W.frame()],
  ['1 … 5', 'colours', ['1', '2', '3', '4', '5'], k => color(info.colors[k - 1])],
  ['H', 'hold the colours’ range', ['h', 'H'], () => send({ do: 'hold', on: !W.status.hold })],
  ['W', 'wireframe', ['w', 'W'], () => wires()],
  ['C', 'show the element that sets the step', ['c', 'C'], () => { culprit.visible = !culprit.visible; dirty = true; }],
  ['Esc', 'let go', ['Escape'], drop],
  ['?', 'keys', ['?'], () => help()],
];
addEventListener('keydown', e => {
  if (!info || e.ctrlKey || e.metaKey || (e.target.tagName == 'INPUT' && e.target.type != 'range')) return;
  const key = KEYS.find(k => k[2].includes(e.key));
  if (window.tisoftRecording) {
    if (e.key == ' ') play.turn();
    else if (e.key == 'ArrowRight' || e.key == 'ArrowLeft') play.go(play.frame + (e.key == 'ArrowRight' ? 1 : -1), true);
    else if ('fFwWcCHome'.includes(e.key) && key) key[3](e.key);
    else return;
    e.preventDefault();
  } else if (key) { key[3](e.key); e.preventDefault(); }
});
const short = at('help').textContent;
function help() {
  const all = KEYS.map(k => `${k[0]}: ${k[1]}`).join('\n');
  at('help').textContent = at('help').textContent == short ? `left drag on the body: pull it\nwith Shift on a pin or an obstacle: carry it\nelsewhere, or with Alt: turn the view\nright drag: move the view · wheel: zoom\n${all}` : short;
}
function color(name) { send({ do: 'color', name }); at('color').value = name; }
function record() { send({ do: 'record', on: !W.status.recording, kind: at('kind').value }); }
function wires() { mesh.material.wireframe = !mesh.material.wireframe; dirty = true; }

const shown = {};                           // sliders by id: what sets one to a value that others gave
function slider(label, id, lo, hi, value, post, log) {
  const typed = make('input', { className: 'value', id: id + '-value', value: words(value), ariaLabel: label });
  // log: from lo on; 'soft': from 0 on, in four decades
  const share = x => 1000 * (log == 'soft' ? Math.log1p(9999 * x / hi) / Math.log(1e4) : log ? Math.log(x / lo) / Math.log(hi / lo) : (x - lo) / (hi - lo));
  const bar = make('input', { type: 'range', min: 0, max: 1000, id, value: share(value), ariaLabel: label });
  let timer = 0, mine = -1e9;
  bar.oninput = () => {
    const x = () => { const s = bar.value / 1000; return log == 'soft' ? hi * (1e4 ** s - 1) / 9999 : log ? lo * (hi / lo) ** s : lo + (hi - lo) * s; };
    typed.value = words(x());
    mine = performance.now();
    if (!timer) timer = setTimeout(() => { timer = 0; mine = performance.now(); post(x()); }, 40);
  };
  shown[id] = x => {
    if (x == value || timer || performance.now() - mine < 1500 || document.activeElement == typed) return;
    value = x; typed.value = words(x); bar.value = share(x);
  };
  typed.onchange = () => {
    typed.blur();
    const x = Number(typed.value);
    if (typed.value.trim() && Number.isFinite(x)) { mine = performance.now(); value = NaN; post(x); bar.value = share(x); }
    else say(`${label}: "${typed.value}" is not a number`);
  };
  return make('label', {}, typed, label, bar);
}
const NUMBERS = { young: ['Young E, Pa', true], poisson: ['Poisson ν'], phi: ['viscosity φ, Pa·s'], eta: ['viscosity η, Pa·s'], point_damping: ['damping, 1/s'], spring_damping: ['spring damping, N·s/m'] };

function panel() {
  const p = at('panel');
  p.replaceChildren();
  const button = (text, id, onclick) => make('button', { textContent: text, id, onclick });
  const stops = [];
  for (let i = 0; i < 256; i += 15) stops.push(`rgb(${info.map.slice(3 * i, 3 * i + 3)})`);
  const bar = [make('div', { id: 'bar', style: `background:linear-gradient(to right,${stops})` })];
  if (info.frames) {                        // a recording: it plays
    p.append(button('pause', 'pause', () => play.turn()), button('frame', 'step', () => play.go(play.frame + 1, true)), button('view', 'frame', () => W.frame()), button('wires', 'wires', wires));
    p.append(...bar, make('div', { id: 'ends' }, make('span', { textContent: '0' }), make('span', { id: 'top' })));
    p.append(slider('time, s', 'at', 0, (info.frames - 1) / info.rate || 1, 0, t => play.go(Math.round(t * info.rate), true)));
    p.append(slider('speed', 'speed', 0.01, 10, 1, value => { play.speed = value; }, true));
  } else {
    p.append(button('pause', 'pause', () => send({ do: 'pause', on: !W.status.paused })), button('frame', 'step', () => send({ do: 'step' })), button('reset', 'reset', () => send({ do: 'reset' })), button('undo', 'undo', () => send({ do: 'undo' })), button('view', 'frame', () => W.frame()));
    const choice = make('select', { id: 'color', ariaLabel: 'colours', onchange: e => color(e.target.value) }, ...info.colors.map(c => make('option', { textContent: c, value: c, selected: c == info.color })));
    p.append(choice, button('hold', 'hold', () => send({ do: 'hold', on: !W.status.hold })), button('wires', 'wires', wires));
    const top = make('input', { id: 'top', className: 'value', ariaLabel: 'upper end of the colours', title: 'type a value to hold it' });
    top.onchange = () => { const x = Number(top.value); if (x > 0) send({ do: 'range', value: x }); else say(`colours: "${top.value}" is not a number above 0`); top.blur(); };
    p.append(...bar, make('div', { id: 'ends' }, make('span', { textContent: '0' }), make('span', {}, top, make('span', { id: 'unit' }))));
    const kinds = ['mp4', 'gif', 'webp', 'html'].map(k => make('option', { textContent: k, value: k }));
    p.append(make('div', { id: 'records' }, button('record', 'record', record), make('select', { id: 'kind', ariaLabel: 'kind of recording' }, ...kinds), make('span', { id: 'file' })));
    p.append(slider('speed', 'speed', 0.01, 10, 1, value => send({ do: 'speed', value }), true));
    p.append(slider('gravity, m/s²', 'gravity', -20, 20, info.gravity, value => send({ do: 'gravity', value })));
  }
  if (info.probes.length) {
    plot.box = make('canvas', { id: 'plot', width: 448, height: 160 });
    const ways = make('select', { id: 'way', ariaLabel: 'what probes show', onchange: e => { plot.way = e.target.value; plot.late = true; } }, ...plot.ways.map(w => make('option', { textContent: w, value: w })));
    p.append(make('h2', {}, 'probes ', ways, ...info.probes.map((name, k) => make('span', { textContent: ` ${name}`, style: `color:${plot.color(k)}` }))), plot.box);
    p.append(make('div', { id: 'plotted' }, make('span', { id: 'plot-lo' }), make('span', { id: 'plot-hi' })));
  }
  if (!info.frames) info.bodies.forEach((body, i) => {
    p.append(make('h2', { textContent: `${body.name} · ${body.kind}` }));
    for (const [name, value] of Object.entries(body.model)) {
      const [label, log] = NUMBERS[name], post = x => send({ do: 'material', body: i, name, value: x });
      const id = `${name}-${i}`, most = name == 'point_damping' ? 100 : Math.max(10, 30 * value, 0.01 * (body.model.young || 0));
      if (log) p.append(slider(label, id, value / 30, value * 30, value, post, true));
      else if (name == 'poisson') p.append(slider(label, id, 0, 0.49, value, post));
      else p.append(slider(label, id, 0, most, value, post, 'soft'));
    }
  });
}
at('more').onclick = () => at('panel').classList.toggle('shut');
if (innerWidth > 640) at('panel').classList.remove('shut');

const UNITS = { stress: 'Pa', strain: '%', speed: 'm/s' };
let own = '';                               // a sentence of the page itself
function say(text) { own = text; tell(); }
function recorded(r) { return r.writing ? `writing ${r.file}: ${r.written} of ${r.frames} frames` : `recording ${r.frames} frames`; }
function tell() {
  const s = W.status;
  const slow = !s.paused && s.real_time && s.real_time < 0.95 * s.speed;
  at('told').textContent = [
    s.time == null ? '' : `t = ${s.time.toFixed(2)} s${s.paused ? ' · paused' : ''}`,
    s.paused || !s.real_time ? '' : `real time × ${s.real_time.toFixed(2)}${slow ? ' · slow motion' : ''}`,
    s.dropped > 0.05 ? `debt dropped ${s.dropped.toFixed(1)} s` : '',
    s.step == null ? '' : `step ${words(s.step)} s${s.share ? `, ${Math.round(100 * s.share)} % of the stable one` : ''}`,
    s.limit && s.limit.element >= 0 && s.limit.body ? `set by ${s.limit.kind} ${s.limit.element} of ${s.limit.body}` : '',
    s.pull == null || (s.carries && s.carries.length) ? '' : `pull ${words(s.pull)} N`,
    ...(s.carries || []).map(name => `carrying ${name}`),
    s.recording ? recorded(s.recording) : s.said || '',
    W.rate == null ? '' : `${W.rate} pictures/s`,
    ...(s.warnings || []),
  ].filter(Boolean).join('\n');
  const wrong = s.error || own;
  at('error').hidden = !wrong;
  at('words').textContent = wrong;
  at('back').hidden = !(s.error && s.undo);
  at('back').textContent = `undo ${s.undo}`;
  if (!info) return;
  at('pause').textContent = s.paused ? 'go on' : 'pause';
  const top = at('top'), shows = UNITS[W.color] ? words(W.top) : '';
  if (info.frames) { top.textContent = `${shows} ${UNITS[W.color] || ''}`; return; }
  at('hold').textContent = s.hold ? 'free' : 'hold';
  at('undo').disabled = !s.undo;
  at('undo').title = s.undo ? `undo ${s.undo}` : '';
  at('record').textContent = s.recording ? (s.recording.writing ? 'writing' : 'end') : 'record';
  at('record').classList.toggle('on', !!s.recording);
  at('file').textContent = s.recording ? ` ${s.recording.file}` : '';
  if (document.activeElement != top) top.value = shows;
  at('unit').textContent = ` ${UNITS[W.color] || ''}`;
  if (document.activeElement != at('color') && s.color) at('color').value = s.color;
  if (!s.numbers) return;
  shown.speed(s.speed); shown.gravity(s.numbers.gravity);
  s.numbers.models.forEach((model, i) => Object.entries(model).forEach(([name, x]) => shown[`${name}-${i}`] && shown[`${name}-${i}`](x)));
}
at('back').onclick = () => send({ do: 'undo' });
setInterval(tell, 1000);                    // sliders that were in use take the scene's values after a while

// -- a recording: the frames are in the page ------------------------------------------------------------
const play = { frame: -1, running: true, speed: 1, clock: 0, frames: [],
  async open(hello) {
    info = hello;
    const bytes = Uint8Array.from(atob(at('tisoft-frames').textContent), c => c.charCodeAt(0));
    const raw = await new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream('deflate'))).arrayBuffer();
    const { rows: n, extra: m, least, span } = hello, last = new Uint16Array(3 * n), view = new DataView(raw);
    for (let f = 0, from = 0; f < hello.frames; f++) {
      const b = new ArrayBuffer(20 + 4 * m + 13 * n), head = new DataView(b), p = new Float32Array(b, 20 + 4 * m, 3 * n);
      head.setUint32(0, f + 1, true);
      new Uint8Array(b, 8, 12 + 4 * m).set(new Uint8Array(raw, from, 12 + 4 * m));
      from += 12 + 4 * m;
      for (let i = 0; i < 3 * n; i++, from += 2) { last[i] += view.getUint16(from, true); p[i] = least[i % 3] + span[i % 3] * last[i] / 65535; }
      new Uint8Array(b, 20 + 4 * m + 12 * n).set(new Uint8Array(raw, from, n));
      from += n;
      this.frames.push(b);
    }
    build(hello);
    at('help').textContent = 'drag: turn · wheel: zoom · Space: pause · → one frame · W wireframe';
    this.go(0);
  },
  turn() { this.running = !this.running; if (this.running && this.frame == this.frames.length - 1) this.go(0); W.status.paused = !this.running; tell(); },
  go(k, stop) {
    if (stop) { this.running = false; W.status.paused = true; }
    this.frame = Math.max(0, Math.min(k, this.frames.length - 1));
    this.clock = this.frame / info.rate;
    newest = this.frames[this.frame];
    W.frames = this.frames.length; W.playing = this.frame;
  },
  tick(seconds) {
    if (!this.frames.length) return;
    if (this.running) {
      this.clock += seconds * this.speed;
      let k = Math.floor(this.clock * info.rate);
      if (k >= this.frames.length) k = this.clock = 0;
      if (k != this.frame) { const clock = this.clock; this.go(k); this.clock = clock; }
    }
    W.status = { paused: !this.running, time: W.time };
    shown.at && shown.at(this.frame / info.rate);
    tell();
  },
};

// -- the connection -----------------------------------------------------------------------------------
let socket, tries = 0;
function connect() {
  const where = new URL('.', location.href);
  where.protocol = where.protocol == 'https:' ? 'wss:' : 'ws:';
  where.search = `?key=${encodeURIComponent(ask.get('key') || '')}`;
  socket = new WebSocket(where);
  W.socket = socket;
  socket.binaryType = 'arraybuffer';
  socket.onmessage = e => {
    if (typeof e.data != 'string') { newest = e.data; W.received++; return; }
    const message = JSON.parse(e.data);
    if (message.hello) {
      tries = 0; own = ''; W.connected = true;
      if (!info) build(message);
      else if (message.rows != info.rows) location.reload();
    } else { W.status = message.status; tell(); }
  };
  socket.onclose = e => {
    W.connected = false;
    newest = null; held = finger = null; wanted = false; orbit.enabled = true; dirty = true;
    if (e.code == 1008) { say(`The page was refused: ${e.reason}.`); return; }
    say(++tries < 5 ? 'The connection is lost; trying again …' : 'The connection is lost. Where tisoft view was started anew, open the address that it printed.');
    setTimeout(connect, Math.min(5000, 500 * tries));
  };
}
if (window.tisoftRecording) play.open(window.tisoftRecording);
else connect();

// -- drawing: quality falls where pictures take long (no GPU) -----------------------------------------
let slow = 0, before = 0, drewLast = false, count = 0, since = performance.now();
function quality(level) {                   // 1 no shadows, 2 half the pixels, 3 plain light
  W.level = level;
  renderer.shadowMap.enabled = sun.castShadow = level < 1;
  if (level >= 3) scene.traverse(o => {
    if (o.material && o.material.isMeshStandardMaterial) { const m = o.material; o.material = new T.MeshLambertMaterial({ map: m.map, color: m.color, side: m.side, vertexColors: m.vertexColors, wireframe: m.wireframe }); }
  });
  scene.traverse(o => { if (o.material) o.material.needsUpdate = true; });
  shape();
}
function shape() {
  renderer.setPixelRatio(W.level < 2 ? Math.min(devicePixelRatio, 2) : 0.5);
  renderer.setSize(innerWidth, innerHeight, false);
  camera.aspect = innerWidth / innerHeight;
  camera.updateProjectionMatrix();
  dirty = true;
}
addEventListener('resize', shape);
shape();

function loop() {
  requestAnimationFrame(loop);
  const now = performance.now();
  if (drewLast) {
    slow = now - before > 80 ? slow + 1 : Math.max(0, slow - 1);
    if (W.level < 3 && (slow > 4 || (slow > 1 && now - before > 300))) {
      quality(now - before > 300 ? 3 : W.level + 1);
      slow = 0;
    }
  }
  if (window.tisoftRecording) play.tick(Math.min(now - before, 200) / 1000);
  before = now; drewLast = false;
  if (wanted && held) { wanted = false; send({ do: 'drag', point: hit.toArray(), number: ++orders }); }
  const fresh = info ? newest : null;
  if (fresh) { newest = null; show(fresh); }
  if (orbit.update()) dirty = true;
  if (held && held.rows && W.positions) {
    const L = thread.geometry.attributes.position.array;
    for (let k = 0; k < 3; k++) L[k] = held.rows.reduce((sum, row, i) => sum + held.weights[i] * W.positions[3 * row + k], 0);
    hit.toArray(L, 3);
    W.at = [L[0], L[1], L[2]];
    thread.geometry.attributes.position.needsUpdate = true;
  }
  if (held) {
    knob.position.copy(hit);
    knob.scale.setScalar(0.012 * camera.position.distanceTo(hit) / 1.7);
  }
  thread.visible = held != null && held.rows != null; knob.visible = held != null;
  if (dirty && mesh) { dirty = false; renderer.render(scene, camera); count++; drewLast = true; W.drawn++; }
  if (fresh && !window.tisoftRecording) send({ ack: W.number });
  plot.draw();
  if (now - since > 1000) { W.rate = Math.round(1000 * count / (now - since)); count = 0; since = now; }
}
loop();
