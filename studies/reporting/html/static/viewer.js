"use strict";
/* Surfaces side by side in one WebGL 2 context: viewports are rectangles of one canvas with a common camera. */
(() => {
  const element = (id) => document.getElementById(id);
  const data = JSON.parse(element("scenes").textContent);
  const palette = JSON.parse(element("palette").textContent);
  const stage = element("stage"), canvas = element("canvas"), grid = element("viewports");
  const gl = canvas.getContext("webgl2", { alpha: true, antialias: true, preserveDrawingBuffer: true });
  if (!gl || typeof DecompressionStream === "undefined") {
    element("viewer").hidden = true;
    element("fallback").hidden = false;
    return;
  }

  const NO_LABEL = 255, CREASE = Math.cos(Math.PI / 4), MARGIN = 1.12, FADED = 0.78, PALE = 0.6, SPOT = 0.035, CLICK = 5, STEPS = 254, TALL = 0.6, EIGENVECTOR_STEPS = 32767;
  const VIRIDIS = ["#440154", "#482878", "#3e4989", "#31688e", "#26828e", "#1f9e89", "#35b779", "#6ece58", "#b5de2b", "#fde725"];
  const BLUE_TO_RED = ["#2166ac", "#4393c3", "#92c5de", "#d1e5f0", "#f7f7f7", "#fddbc7", "#f4a582", "#d6604d", "#b2182b"];

  // What a corner of a triangle has: place, normal, colour number of its face, whether it changed, value of a function.
  const VERTEX = `#version 300 es
    in vec3 place; in vec3 normal; in float label; in float changed; in float value;
    uniform mat3 turn; uniform vec3 low, size, centre; uniform vec2 scale; uniform float depth;
    out vec3 facing, here; flat out float part; out float change; out float amount;
    void main() {
      here = low + place * size;
      vec3 at = turn * (here - centre);
      gl_Position = vec4(at.xy * scale, -at.z * depth, 1.0);
      facing = turn * normal; part = label; change = changed; amount = value;
    }`;
  const FRAGMENT = `#version 300 es
    precision highp float;
    in vec3 facing, here; flat in float part; in float change; in float amount;
    uniform sampler2D colours, ramp; uniform int mode; uniform bool highlight, pale; uniform vec3 faded; uniform vec4 spot;
    out vec4 colour;
    void main() {
      vec3 n = normalize(facing);
      if (!gl_FrontFacing) n = -n;
      vec3 base = mode == 1
        ? (amount > 0.998 ? vec3(0.6) : texture(ramp, vec2(amount * 255.0 / 254.0, 0.5)).rgb)
        : texelFetch(colours, ivec2(int(part + 0.5), 0), 0).rgb;
      if (highlight) {
        if (change < 0.5) base = mix(base, faded, ${FADED});
        else if (mod(gl_FragCoord.x + gl_FragCoord.y, 9.0) < 2.2) base = vec3(0.0);
      }
      if (pale && change > 0.5) base = mix(base, vec3(1.0), ${PALE});
      float away = distance(here, spot.xyz);
      if (away < spot.w) base = away < 0.7 * spot.w ? vec3(0.85, 0.05, 0.05) : vec3(1.0);
      float light = 0.85 * max(dot(n, normalize(vec3(-0.4, 0.6, 1.0))), 0.0) + 0.3 * max(dot(n, normalize(vec3(0.8, -0.2, 0.6))), 0.0);
      colour = vec4(min(base * (mode == 1 ? 0.5 + 0.5 * light : 0.3 + 0.75 * light), 1.0), 1.0);
    }`;

  const compiled = (type, source) => {
    const shader = gl.createShader(type);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    return shader;
  };
  const program = gl.createProgram();
  gl.attachShader(program, compiled(gl.VERTEX_SHADER, VERTEX));
  gl.attachShader(program, compiled(gl.FRAGMENT_SHADER, FRAGMENT));
  gl.bindAttribLocation(program, 0, "place"); // always an array, as Firefox wants the first one to be
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
  gl.useProgram(program);
  const attribute = (name) => gl.getAttribLocation(program, name);
  const uniform = (name) => gl.getUniformLocation(program, name);
  const ATTRIBUTES = ["place", "normal", "label", "changed", "value"].map(attribute);
  const U = Object.fromEntries(["turn", "low", "size", "centre", "scale", "depth", "colours", "ramp", "mode", "highlight", "faded", "pale", "spot"]
    .map((name) => [name, uniform(name)]));

  const rgb = (hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16));
  const texture = (unit, colours, filter) => {
    gl.activeTexture(gl.TEXTURE0 + unit);
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    const pixels = new Uint8Array(colours.flatMap((hex) => [...rgb(hex), 255]));
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, colours.length, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, filter);
    for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, name, gl.CLAMP_TO_EDGE);
  };
  const grey = palette.length - 1;
  const colourOf = (label) => (label === NO_LABEL ? grey : label % grey);
  texture(0, palette, gl.NEAREST);
  texture(1, VIRIDIS, gl.LINEAR);
  texture(2, BLUE_TO_RED, gl.LINEAR);
  gl.uniform1i(U.colours, 0);
  gl.enable(gl.DEPTH_TEST);
  gl.enable(gl.SCISSOR_TEST);

  let blocks;
  const block = (number) => {
    const [start, length] = data.blocks[number];
    return blocks.subarray(start, start + length);
  };
  const buffer = (array) => {
    const made = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, made);
    gl.bufferData(gl.ARRAY_BUFFER, array, gl.STATIC_DRAW);
    return made;
  };

  /* Geometry of a surface, made when it is first shown: each corner of each face apart, so that faces have one colour
     and creases are sharp. */
  const surfaces = new Map();
  const surfaceOf = (number) => {
    if (surfaces.has(number)) return surfaces.get(number);
    const packed = data.surfaces[number];
    const raw = block(packed.positions);
    const positions = new Uint16Array(raw.buffer, raw.byteOffset, raw.length / 2);
    const rawFaces = block(packed.faces);
    const faces = packed.wide
      ? new Uint32Array(rawFaces.buffer, rawFaces.byteOffset, rawFaces.length / 4)
      : new Uint16Array(rawFaces.buffer, rawFaces.byteOffset, rawFaces.length / 2);
    const n = faces.length, m = n / 3;
    const at = (v, k) => packed.low[k] + (positions[3 * v + k] / 65535) * packed.size[k];
    const ofFaces = new Float32Array(n); // normals, as long as twice the area
    for (let f = 0; f < m; f++) {
      const [a, b, c] = [faces[3 * f], faces[3 * f + 1], faces[3 * f + 2]];
      const p = [0, 1, 2].map((k) => at(b, k) - at(a, k)), q = [0, 1, 2].map((k) => at(c, k) - at(a, k));
      for (let k = 0; k < 3; k++) {
        const [i, j] = [(k + 1) % 3, (k + 2) % 3];
        ofFaces[3 * f + k] = p[i] * q[j] - p[j] * q[i];
      }
    }
    const length = (f) => Math.hypot(ofFaces[3 * f], ofFaces[3 * f + 1], ofFaces[3 * f + 2]) || 1e-30;
    const lengths = Float32Array.from({ length: m }, (_, f) => length(f));
    const nVertices = positions.length / 3;
    const start = new Uint32Array(nVertices + 1), around = new Uint32Array(n);
    for (const v of faces) start[v + 1]++;
    for (let v = 0; v < nVertices; v++) start[v + 1] += start[v];
    const filled = start.slice();
    for (let i = 0; i < n; i++) around[filled[faces[i]]++] = (i / 3) | 0;
    const place = new Uint16Array(n * 4), normal = new Int8Array(n * 4);
    for (let i = 0; i < n; i++) {
      const v = faces[i], f = (i / 3) | 0;
      let x = 0, y = 0, z = 0;
      for (let j = start[v]; j < start[v + 1]; j++) {
        const g = around[j];
        const cosine = (ofFaces[3 * f] * ofFaces[3 * g] + ofFaces[3 * f + 1] * ofFaces[3 * g + 1] + ofFaces[3 * f + 2] * ofFaces[3 * g + 2])
          / (lengths[f] * lengths[g]);
        if (g === f || cosine > CREASE) { x += ofFaces[3 * g]; y += ofFaces[3 * g + 1]; z += ofFaces[3 * g + 2]; }
      }
      const long = Math.hypot(x, y, z) || 1;
      normal.set([x / long * 127, y / long * 127, z / long * 127], 4 * i);
      place.set(positions.subarray(3 * v, 3 * v + 3), 4 * i);
    }
    const made = { packed, faces, place: buffer(place), normal: buffer(normal), count: n };
    surfaces.set(number, made);
    return made;
  };

  /* Values at the corners: a face has the label of two of its corners, else that of the first. */
  const layers = new Map();
  const layerOf = (surface, number, byFace) => {
    const key = `${surface} ${number} ${byFace}`;
    if (layers.has(key)) return layers.get(key);
    const { faces } = surfaceOf(surface);
    const values = block(number), corners = new Uint8Array(faces.length);
    for (let i = 0; i < faces.length; i += 3) {
      const [a, b, c] = [values[faces[i]], values[faces[i + 1]], values[faces[i + 2]]];
      if (byFace) corners.fill(colourOf(b === c ? b : a), i, i + 3);
      else corners.set([a, b, c], i);
    }
    const made = buffer(corners);
    layers.set(key, made);
    return made;
  };

  /* Heat from a vertex at every other: the sum over eigenpairs of e^(-λt) φ(x) φ(y), 0 on other components. */
  const heats = new Map();
  const heatOf = (heat, point) => {
    const key = `${heat.vectors} ${heat.time} ${point}`;
    if (heats.has(key)) return heats.get(key);
    const raw = block(heat.vectors), rawComponents = block(heat.components);
    const vectors = new Int16Array(raw.buffer, raw.byteOffset, raw.length / 2);
    const components = new Uint32Array(rawComponents.buffer, rawComponents.byteOffset, rawComponents.length / 4);
    const pairs = heat.scales.length, n = vectors.length / pairs, values = new Float32Array(n);
    const weights = heat.scales.map((scale, i) => {
      const eigenvalue = heat.eigenvalues[components[point]][i];
      return eigenvalue === null ? 0 : Math.exp(-eigenvalue * heat.time) * (scale / EIGENVECTOR_STEPS) ** 2 * vectors[point * pairs + i];
    });
    for (let v = 0; v < n; v++) {
      let sum = 0;
      if (components[v] === components[point]) for (let i = 0; i < pairs; i++) sum += weights[i] * vectors[v * pairs + i];
      values[v] = sum;
    }
    if (heats.size > 60) heats.clear();
    heats.set(key, values);
    return values;
  };
  const heatLayer = (viewport, values, highest) => {
    const { faces } = surfaceOf(viewport.surface);
    const corners = Uint8Array.from(faces, (v) => Math.round(STEPS * Math.min(1, Math.max(0, values[v] / highest))));
    if (viewport.heatBuffer) gl.deleteBuffer(viewport.heatBuffer);
    viewport.heatBuffer = buffer(corners);
    return viewport.heatBuffer;
  };
  const placeOf = (surface, v) => {
    const packed = data.surfaces[surface], raw = block(packed.positions);
    const positions = new Uint16Array(raw.buffer, raw.byteOffset, raw.length / 2);
    return [0, 1, 2].map((k) => packed.low[k] + (positions[3 * v + k] / 65535) * packed.size[k]);
  };
  const bytes = (index, made, normalised) => {
    if (made === null) {
      gl.disableVertexAttribArray(ATTRIBUTES[index]);
      gl.vertexAttrib1f(ATTRIBUTES[index], index === 2 ? grey : 0);
      return;
    }
    gl.bindBuffer(gl.ARRAY_BUFFER, made);
    gl.enableVertexAttribArray(ATTRIBUTES[index]);
    gl.vertexAttribPointer(ATTRIBUTES[index], 1, gl.UNSIGNED_BYTE, normalised, 0, 0);
  };

  // What is shown.
  const state = { scene: 0, hidden: new Set(), highlight: false, field: "", turn: null, zoom: 1, shift: [0, 0], points: new Map() };
  const names = Object.keys(data.scenes[0].at);
  const selects = names.filter((name) => name !== data.slider);
  const rows = [...new Set(data.scenes.flatMap((scene) => scene.viewports.map((each) => each.row)))];
  /* The rows of the scene but those that are hidden; all of them if all are. */
  const shownRows = () => {
    const ofScene = [...new Set(scene().viewports.map((each) => each.row))], shown = ofScene.filter((row) => !state.hidden.has(row));
    return shown.length ? shown : ofScene;
  };
  const scene = () => data.scenes[state.scene];

  // The vertex that heat comes from: one for each viewport of a plate, whatever the slider says.
  const pointKey = (i) => `${selects.map((name) => scene().at[name])} ${i}`;
  const pointOf = (viewport, i) => state.points.get(pointKey(i)) ?? viewport.heat.point;
  const shownField = (viewport) => viewport.fields[viewport.shows ?? state.field];
  const hottest = () => Math.max(1e-30, ...cells.map(({ viewport }, i) => (viewport.heat
    ? heatOf(viewport.heat, pointOf(viewport, i)).reduce((a, b) => Math.max(a, b), 0) : 0)));

  const multiply = (a, b) => { // 3 x 3, row by row
    const product = [];
    for (let i = 0; i < 3; i++) for (let j = 0; j < 3; j++) product.push(a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] + a[3 * i + 2] * b[6 + j]);
    return product;
  };
  const about = (axis, angle) => {
    const [c, s] = [Math.cos(angle), Math.sin(angle)];
    return axis === "x" ? [1, 0, 0, 0, c, -s, 0, s, c] : [c, 0, s, 0, 1, 0, -s, 0, c];
  };
  const reset = () => {
    state.turn = scene().axes ?? [1, 0, 0, 0, 1, 0, 0, 0, 1];
    state.zoom = 1;
    state.shift = [0, 0];
  };
  const rotate = (x, y) => { state.turn = multiply(multiply(about("x", y), about("y", x)), state.turn); draw(); };
  const zoom = (factor) => { state.zoom = Math.min(40, Math.max(0.2, state.zoom * factor)); draw(); };

  /* The frame of a scene: that of all its surfaces, unless one is much larger, or elsewhere: each then has its own. */
  const boxOf = (packed) => ({
    centre: packed.low.map((low, k) => low + packed.size[k] / 2),
    radius: packed.radius,
  });
  const framesOf = (viewports) => {
    const boxes = viewports.map((each) => boxOf(data.surfaces[each.surface]));
    const first = boxes[0];
    const alike = boxes.every((box) => box.radius < 1.7 * first.radius && first.radius < 1.7 * box.radius
      && Math.hypot(...box.centre.map((value, k) => value - first.centre[k])) < 0.5 * first.radius);
    if (!alike) return boxes;
    const radius = Math.max(...boxes.map((box) => box.radius));
    return boxes.map(() => ({ centre: first.centre, radius }));
  };

  /* The directions right, up and towards the camera of a viewport: as turned, from where it is seen first. */
  const turnOf = (viewport) => {
    const a = scene().axes ?? [1, 0, 0, 0, 1, 0, 0, 0, 1];
    return viewport.axes ? multiply(multiply(state.turn, [a[0], a[3], a[6], a[1], a[4], a[7], a[2], a[5], a[8]]), viewport.axes) : state.turn;
  };
  let cells = [];
  const layOut = () => {
    const visible = shownRows(), shown = scene().viewports.filter((each) => visible.includes(each.row));
    const perRow = Math.max(...shownRows().map((row) => shown.filter((each) => each.row === row).length), 1);
    const most = Math.max(2, Math.floor(grid.clientWidth / 200)), lines = Math.ceil(perRow / most);
    const inRow = Math.ceil(perRow / lines);
    const columns = shownRows().length > 1 && grid.clientWidth > 1000 && lines === 1 ? perRow * Math.min(shownRows().length, 2) : inRow;
    grid.style.gridTemplateColumns = `repeat(${columns}, minmax(0, 1fr))`;
    grid.classList.toggle("many", shown.length > 4 && lines > 1);
    grid.replaceChildren();
    const frames = shown.length ? framesOf(shown) : [];
    cells = shown.map((viewport, i) => {
      const cell = document.createElement("div");
      cell.className = "viewport";
      const title = document.createElement("p");
      title.className = "title";
      const bold = document.createElement("b");
      bold.textContent = viewport.title;
      title.append(bold, rows.length > 1 && viewport.row ? ` ${viewport.row}` : "");
      const note = document.createElement("p");
      note.className = "note";
      note.textContent = viewport.note;
      cell.append(title, note);
      if (viewport.shows || viewport.heat) cell.append(make("span", { className: "scale" }));
      grid.append(cell);
      return { cell, viewport, frame: frames[i] };
    });
    // A finger scrolls past a viewer that would otherwise fill the screen of a phone.
    stage.style.touchAction = stage.clientHeight > TALL * innerHeight ? "pan-y" : "none";
    scales();
  };
  const scales = () => {
    for (const { cell, viewport } of cells) {
      const scale = cell.querySelector(".scale");
      if (scale && viewport.shows) fillScale(scale, viewport.fields[viewport.shows]);
      else if (scale && blocks) fillScale(scale, { low: 0, high: hottest(), unit: "" });
    }
  };

  const paint = (density) => {
    const box = stage.getBoundingClientRect();
    const [width, height] = [Math.round(stage.clientWidth * density), Math.round(stage.clientHeight * density)];
    if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
    gl.viewport(0, 0, width, height);
    gl.scissor(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const background = getComputedStyle(stage).backgroundColor.match(/\d+/g).slice(0, 3).map((each) => each / 255);
    gl.uniform3fv(U.faded, background.map((each) => 0.55 * each + 0.35));
    const highest = cells.some(({ viewport }) => viewport.heat) ? hottest() : 1;
    for (const [i, { cell, viewport, frame }] of cells.entries()) {
      const inner = cell.getBoundingClientRect();
      const x = Math.round((inner.left - box.left - stage.clientLeft) * density);
      const y = Math.round(height - (inner.bottom - box.top - stage.clientTop) * density);
      const [w, h] = [Math.round(inner.width * density), Math.round(inner.height * density)];
      gl.viewport(x, y, w, h);
      gl.scissor(x, y, w, h);
      const surface = surfaceOf(viewport.surface);
      const reach = frame.radius * MARGIN / state.zoom;
      const unit = Math.min(w, h) / 2 / reach;
      const t = turnOf(viewport); // rows are right, up and towards the camera
      gl.uniformMatrix3fv(U.turn, false, [t[0], t[3], t[6], t[1], t[4], t[7], t[2], t[5], t[8]]);
      gl.uniform3fv(U.low, surface.packed.low);
      gl.uniform3fv(U.size, surface.packed.size);
      const moved = [0, 1, 2].map((k) => frame.centre[k] - (t[k] * state.shift[0] + t[3 + k] * state.shift[1]) * frame.radius);
      gl.uniform3fv(U.centre, moved);
      gl.uniform2f(U.scale, unit / (w / 2), unit / (h / 2));
      gl.uniform1f(U.depth, 0.2 / frame.radius);
      const field = shownField(viewport), { heat } = viewport;
      gl.uniform1i(U.mode, field || heat ? 1 : 0);
      gl.uniform4f(U.spot, ...(heat ? [...placeOf(viewport.surface, pointOf(viewport, i)), SPOT * frame.radius / Math.sqrt(state.zoom)] : [0, 0, 0, 0]));
      gl.uniform1i(U.pale, viewport.faded === undefined ? 0 : 1);
      gl.uniform1i(U.ramp, field?.diverging ? 2 : 1);
      gl.uniform1i(U.highlight, state.highlight && viewport.changed !== null ? 1 : 0);
      gl.bindBuffer(gl.ARRAY_BUFFER, surface.place);
      gl.enableVertexAttribArray(ATTRIBUTES[0]);
      gl.vertexAttribPointer(ATTRIBUTES[0], 3, gl.UNSIGNED_SHORT, true, 8, 0);
      gl.bindBuffer(gl.ARRAY_BUFFER, surface.normal);
      gl.enableVertexAttribArray(ATTRIBUTES[1]);
      gl.vertexAttribPointer(ATTRIBUTES[1], 3, gl.BYTE, true, 4, 0);
      bytes(2, viewport.labels === null ? null : layerOf(viewport.surface, viewport.labels, true), false);
      const marked = viewport.faded ?? viewport.changed;
      bytes(3, marked === null ? null : layerOf(viewport.surface, marked, false), false);
      if (heat) bytes(4, heatLayer(viewport, heatOf(heat, pointOf(viewport, i)), highest), true);
      else bytes(4, field ? layerOf(viewport.surface, field.values, false) : null, true);
      gl.drawArrays(gl.TRIANGLES, 0, surface.count);
    }
  };
  let waiting = false;
  const draw = () => {
    if (waiting || !blocks) return;
    waiting = true;
    requestAnimationFrame(() => { waiting = false; paint(Math.min(devicePixelRatio || 1, 2)); });
  };

  // Controls.
  const make = (tag, properties = {}, ...children) => {
    const made = Object.assign(document.createElement(tag), properties);
    made.append(...children);
    return made;
  };
  const valuesOf = (name, fixed) => [...new Set(data.scenes
    .filter((each) => Object.entries(fixed).every(([key, value]) => each.at[key] === value))
    .map((each) => each.at[name]))];
  const controls = {};

  /* The scene with a value picked, which agrees with the present one in as much of the rest as there is. */
  const pick = (name, value) => {
    const at = scene().at;
    const order = [name, ...selects.filter((each) => each !== name), data.slider];
    let best = -1, score = -1;
    data.scenes.forEach((each, i) => {
      if (each.at[name] !== value) return;
      const agreeing = order.reduce((sum, key, k) => sum + (key !== name && each.at[key] === at[key] ? 2 ** (order.length - k) : 0), 0);
      if (agreeing > score) { score = agreeing; best = i; }
    });
    if (best >= 0) show(best);
  };
  const onSlider = () => {
    const fixed = Object.fromEntries(selects.map((name) => [name, scene().at[name]]));
    const found = data.scenes.map((each, i) => i)
      .filter((i) => selects.every((name) => data.scenes[i].at[name] === fixed[name]));
    return found.sort((a, b) => data.scenes[a].at[data.slider] - data.scenes[b].at[data.slider]);
  };
  const choosable = (viewport) => (viewport.shows || viewport.heat ? [] : Object.keys(viewport.fields));
  const build = () => {
    const pickers = element("pickers");
    for (const name of selects) {
      const select = make("select", { id: `pick-${name}`, onchange: () => pick(name, controls[name].values[select.selectedIndex]) });
      const label = make("label", {}, name, select);
      controls[name] = { select, label, values: [] };
      pickers.append(label);
    }
    const slider = make("input", { type: "range", min: 0, step: 1, id: "slider", oninput: () => show(onSlider()[slider.value]) });
    const output = make("output", { htmlFor: "slider" });
    const sliderName = make("span", {}, data.slider);
    const label = make("label", {}, sliderName, slider, output);
    controls.slider = { slider, output, label, sliderName };
    pickers.append(label);
    if (rows.length > 1) {
      const set = make("fieldset", { id: "rows" }, make("legend", {}, "show"));
      controls.rows = new Map();
      for (const row of rows) {
        const box = make("input", { type: "checkbox", checked: !state.hidden.has(row), onchange: () => {
          if (box.checked) state.hidden.delete(row); else state.hidden.add(row);
          layOut();
          draw();
        } });
        controls.rows.set(row, make("label", {}, box, row));
        set.append(controls.rows.get(row));
      }
      pickers.append(set);
    }
    const tools = make("fieldset", { className: "tools" });
    if (data.scenes.some((each) => each.viewports.some((one) => one.changed !== null))) {
      const toggle = make("button", { type: "button", id: "highlight", textContent: "what changed", onclick: () => {
        state.highlight = !state.highlight;
        toggle.setAttribute("aria-pressed", state.highlight);
        draw();
      } });
      toggle.setAttribute("aria-pressed", false);
      tools.append(toggle);
      controls.highlight = toggle;
    }
    const fields = [...new Set(data.scenes.flatMap((each) => each.viewports.flatMap(choosable)))];
    if (fields.length) {
      const select = make("select", { id: "field", onchange: () => { state.field = select.value; legend(); draw(); } },
        make("option", { value: "", textContent: "segments" }), ...fields.map((name) => make("option", { value: name, textContent: name })));
      controls.field = make("label", {}, "colours", select);
      tools.append(controls.field);
    }
    tools.append(make("button", { type: "button", textContent: "reset view", onclick: () => { reset(); draw(); } }));
    pickers.append(tools, make("span", { className: "scale", id: "scale", hidden: true }));

    const worst = data.scenes.map((each, i) => i).filter((i) => data.scenes[i].value !== null)
      .sort((a, b) => data.scenes[b].value - data.scenes[a].value).slice(0, 8);
    if (worst.length > 1) {
      element("worst").append(make("span", {}, "changed most:"), ...worst.map((i) => {
        const button = make("button", { type: "button", textContent: data.scenes[i].text });
        button.dataset.scene = i;
        return button;
      }));
    }
  };
  const legend = () => {
    const scale = element("scale");
    const one = scene().viewports.filter((each) => !each.shows).map((each) => each.fields[state.field]).find(Boolean);
    scale.hidden = !one;
    if (one) fillScale(scale, one);
  };
  const fillScale = (scale, one) => {
    const bar = make("i");
    bar.style.background = `linear-gradient(90deg, ${(one.diverging ? BLUE_TO_RED : VIRIDIS).join(", ")})`;
    const round = (value) => Number(value.toPrecision(3));
    scale.replaceChildren(`${round(one.low)}`, bar, `${round(one.high)}`, ` ${one.unit}`);
  };
  const onlyOneHides = data.scenes.some((each) => each.slider);
  const show = (number) => {
    const before = state.turn && scene().axes;
    state.scene = number;
    const same = before && JSON.stringify(before) === JSON.stringify(scene().axes);
    if (!same) reset();
    const at = scene().at;
    let fixed = {};
    for (const name of selects) {
      const { select, label } = controls[name];
      const values = valuesOf(name, fixed);
      controls[name].values = values;
      select.replaceChildren(...values.map((value) => make("option", { textContent: String(value) })));
      select.selectedIndex = values.indexOf(at[name]);
      label.hidden = valuesOf(name, {}).length < 2;
      label.style.display = label.hidden ? "none" : "";
      fixed = { ...fixed, [name]: at[name] };
    }
    const choices = onSlider();
    const { slider, output, label } = controls.slider;
    slider.max = choices.length - 1;
    slider.value = choices.indexOf(number);
    output.textContent = typeof at[data.slider] === "number" ? Number(at[data.slider].toPrecision(6)) : String(at[data.slider]);
    slider.setAttribute("aria-valuetext", output.textContent);
    slider.disabled = choices.length < 2;
    controls.slider.sliderName.textContent = scene().slider ?? data.slider;
    label.style.display = at[data.slider] === undefined || (choices.length < 2 && onlyOneHides) ? "none" : "";
    controls.rows?.forEach((each, row) => { each.hidden = !scene().viewports.some((one) => one.row === row); });
    if (controls.highlight) controls.highlight.hidden = !scene().viewports.some((each) => each.changed !== null);
    if (controls.field) controls.field.hidden = !scene().viewports.some((each) => choosable(each).length);
    for (const each of document.querySelectorAll("[data-scene]")) {
      const current = Number(each.dataset.scene) === number;
      if (each.tagName === "BUTTON") each.setAttribute("aria-current", current);
      else each.classList.toggle("current", current);
    }
    legend();
    layOut();
    draw();
    document.dispatchEvent(new Event("shown"));
  };

  /* The vertex that is seen at a place of a viewport, in pixels from its middle; -1 beside the surface. */
  const vertexAt = ({ cell, viewport, frame }, x, y) => {
    const { faces } = surfaceOf(viewport.surface), packed = data.surfaces[viewport.surface], t = turnOf(viewport);
    const raw = block(packed.positions), positions = new Uint16Array(raw.buffer, raw.byteOffset, raw.length / 2);
    const unit = Math.min(cell.clientWidth, cell.clientHeight) / 2 / (frame.radius * MARGIN / state.zoom);
    const n = positions.length / 3, seen = new Float32Array(3 * n);
    for (let v = 0; v < n; v++) {
      const p = [0, 1, 2].map((k) => packed.low[k] + (positions[3 * v + k] / 65535) * packed.size[k] - frame.centre[k]);
      for (let r = 0; r < 3; r++) seen[3 * v + r] = unit * (t[3 * r] * p[0] + t[3 * r + 1] * p[1] + t[3 * r + 2] * p[2]);
      for (let r = 0; r < 2; r++) seen[3 * v + r] += unit * state.shift[r] * frame.radius;
      seen[3 * v] -= x;
      seen[3 * v + 1] -= y;
    }
    let best = -1, nearest = -Infinity;
    for (let i = 0; i < faces.length; i += 3) {
      const [a, b, c] = [3 * faces[i], 3 * faces[i + 1], 3 * faces[i + 2]];
      const cross = (p, q) => seen[p] * seen[q + 1] - seen[q] * seen[p + 1];
      const [u, v, w] = [cross(b, c), cross(c, a), cross(a, b)], sum = u + v + w;
      if (!sum || Math.min(u / sum, v / sum, w / sum) < 0) continue;
      const depth = (u * seen[a + 2] + v * seen[b + 2] + w * seen[c + 2]) / sum;
      if (depth <= nearest) continue;
      nearest = depth;
      best = faces[i + [u / sum, v / sum, w / sum].reduce((k, each, j, all) => (each > all[k] ? j : k), 0)];
    }
    return best;
  };
  const pickVertex = (i, x, y) => {
    if (!blocks || !cells[i]?.viewport.heat) return;
    const vertex = vertexAt(cells[i], x, y);
    if (vertex < 0) return;
    state.points.set(pointKey(i), vertex);
    scales();
    draw();
  };
  const clicked = (event) => cells.forEach(({ cell }, i) => {
    const box = cell.getBoundingClientRect();
    const [x, y] = [event.clientX - box.left - box.width / 2, box.top + box.height / 2 - event.clientY];
    if (Math.abs(x) < box.width / 2 && Math.abs(y) < box.height / 2) pickVertex(i, x, y);
  });

  // Pointer, wheel and keys.
  const pointers = new Map();
  let apart = 0, travelled = 0;
  stage.addEventListener("pointerdown", (event) => {
    stage.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, [event.clientX, event.clientY]);
    apart = 0;
    travelled = pointers.size > 1 ? Infinity : 0;
  });
  stage.addEventListener("pointermove", (event) => {
    const before = pointers.get(event.pointerId);
    if (!before) return;
    const [dx, dy] = [event.clientX - before[0], event.clientY - before[1]];
    pointers.set(event.pointerId, [event.clientX, event.clientY]);
    travelled += Math.hypot(dx, dy);
    if (pointers.size === 2) {
      const [[a, b], [c, d]] = [...pointers.values()];
      const distance = Math.hypot(a - c, b - d);
      if (apart) zoom(distance / apart);
      apart = distance;
    } else if (event.shiftKey || event.buttons & 6) {
      const unit = Math.min(cells[0]?.cell.clientWidth ?? 300, cells[0]?.cell.clientHeight ?? 300) / 2 * state.zoom;
      state.shift = [state.shift[0] + dx / unit, state.shift[1] - dy / unit];
      draw();
    } else rotate(dx / 120, dy / 120);
  });
  stage.addEventListener("pointerup", (event) => { if (travelled < CLICK && event.button === 0) clicked(event); });
  for (const name of ["pointerup", "pointercancel"]) stage.addEventListener(name, (event) => { pointers.delete(event.pointerId); apart = 0; });
  stage.addEventListener("contextmenu", (event) => event.preventDefault());
  stage.addEventListener("wheel", (event) => { event.preventDefault(); zoom(Math.exp(-event.deltaY * (event.deltaMode ? 0.04 : 0.0015))); }, { passive: false });
  stage.addEventListener("dblclick", () => { reset(); draw(); });
  const KEYS = {
    ArrowLeft: () => rotate(-0.17, 0), ArrowRight: () => rotate(0.17, 0), ArrowUp: () => rotate(0, -0.17), ArrowDown: () => rotate(0, 0.17),
    "+": () => zoom(1.2), "=": () => zoom(1.2), "-": () => zoom(1 / 1.2), Home: () => { reset(); draw(); }, 0: () => { reset(); draw(); },
    Enter: () => pickVertex(cells.findIndex(({ viewport }) => viewport.heat), 0, 0),
  };
  stage.addEventListener("keydown", (event) => {
    if (KEYS[event.key] && !event.ctrlKey && !event.metaKey) { event.preventDefault(); KEYS[event.key](); }
  });
  new ResizeObserver(() => { layOut(); draw(); }).observe(stage.parentElement);
  document.addEventListener("theme", draw);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);

  // On paper there is a picture of what is drawn.
  const printed = element("printed");
  addEventListener("beforeprint", () => {
    if (!blocks) return;
    paint(3);
    printed.src = canvas.toDataURL("image/png");
    printed.hidden = false;
  });
  addEventListener("afterprint", () => { printed.hidden = true; draw(); });

  // Browsers may take the context away, and give it back empty: everything is made again.
  canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
  canvas.addEventListener("webglcontextrestored", () => location.reload());

  const unpack = async () => {
    const binary = Uint8Array.from(atob(data.data), (character) => character.charCodeAt(0));
    const stream = new Blob([binary]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Uint8Array(await new Response(stream).arrayBuffer());
  };
  const most = Math.max(...data.scenes.map((each) => new Set(each.viewports.map((one) => one.row)).size));
  if (most > 2) rows.slice(2).forEach((row) => state.hidden.add(row));
  build();
  window.viewer = {
    show, state, data, scene, pickVertex, paint: (density = 1) => paint(density), cells: () => cells,
    heat: (i) => heatOf(cells[i].viewport.heat, pointOf(cells[i].viewport, i)), point: (i) => pointOf(cells[i].viewport, i),
  };
  show(0);
  window.viewer.ready = unpack().then((made) => {
    blocks = made;
    delete data.data;
    scales();
    paint(Math.min(devicePixelRatio || 1, 2));
    stage.dataset.ready = "true";
  });
})();
