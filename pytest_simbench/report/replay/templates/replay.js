"use strict";
(() => {
  /* global THREE, scene, camera, renderer, controls, tracklight */
  const get = (id) => document.getElementById(id);
  const data = JSON.parse(get("data").textContent);
  const state = { time: 0, playing: false, last: 0, group: 0, ghost: -1, tiles: [], frames: 0 };
  const GHOST = 0.3;

  // Motions: differences of whole numbers, packed; column k of tile.table is k * samples onwards.
  async function unpacked(tile) {
    if (tile.table) return;
    const bytes = Uint8Array.from(atob(tile.motion), (letter) => letter.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    const table = new Int32Array(await new Response(stream).arrayBuffer());
    for (let at = 0; at < table.length; at++) if (at % tile.samples) table[at] += table[at - 1];
    tile.motion = null;
    tile.table = table;
  }
  function sample(tile, time) {
    let [low, high] = [0, tile.samples - 1];
    const wanted = Math.round(time * data.scale);
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (tile.table[middle] <= wanted) low = middle;
      else high = middle - 1;
    }
    return low;
  }
  const value = (tile, column, at) => tile.table[column * tile.samples + at] / data.scale;
  const end = (tile) => value(tile, 0, tile.samples - 1);

  // Bodies: one set for each group, placed anew for each tile that is drawn.
  const geometry = (name) => viewed.getObjectByName(name).geometry;
  let viewed = null;
  function placed(object, [x, y, z, qw, qx, qy, qz]) {
    object.position.set(x, y, z);
    object.quaternion.set(qx, qy, qz, qw);
    return object;
  }
  function shaped(part, material) {
    const name = part.kind || (part.size ? "box" : `mesh_${part.mesh}`);
    const mesh = new THREE.Mesh(geometry(name), material);
    if (part.size) mesh.scale.set(...part.size);
    return placed(mesh, part.pose);
  }
  function built(box, material) {
    if (!box.solids) return shaped(box, material);
    const group = placed(new THREE.Group(), box.pose);
    for (const solid of box.solids) group.add(shaped(solid, material));
    return group;
  }
  function painted([r, g, b, a], ghost) {
    const opacity = ghost ? GHOST : a;
    const material = new THREE.MeshStandardMaterial({
      color: new THREE.Color(r, g, b), roughness: 0.7, flatShading: true,
      opacity, transparent: opacity < 1, depthWrite: opacity === 1,
    });
    return material;
  }
  function links(root, figure, hinges, ghost) {
    const found = new Map([[figure.root, new THREE.Group()]]);
    root.add(found.get(figure.root));
    for (const hinge of figure.hinges) {
      const frame = placed(new THREE.Group(), hinge.origin);
      const link = new THREE.Group();
      found.get(hinge.parent).add(frame);
      frame.add(link);
      link.name = hinge.child;
      found.set(hinge.child, link);
      const axis = new THREE.Vector3(...hinge.axis);
      hinges.push({ link, axis, slides: hinge.kind === "prismatic", name: hinge.name });
    }
    const metal = painted(data.metal, ghost);
    for (const part of figure.parts) found.get(part.link).add(shaped(part, metal));
    return found.get(figure.root);
  }
  function body(tile, ghost) {
    const root = new THREE.Group();
    root.name = ghost ? "ghost" : "tile";
    const free = tile.boxes.map((box, k) => {
      const mesh = built(box, painted(box.colour, ghost));
      mesh.name = `body ${k}`;
      if (!ghost || k < tile.free) root.add(mesh);
      return mesh;
    });
    const hinges = [];
    scene.add(root);
    const parts = tile.figure ? [links(root, tile.figure, hinges, ghost)] : [];
    return { root, free: free.slice(0, tile.free), hinges, links: parts };
  }
  function pose(shown, tile, time) {
    const at = sample(tile, time);
    for (const hinge of shown.hinges) {
      const position = value(tile, 1 + tile.joints.indexOf(hinge.name), at);
      if (hinge.slides) hinge.link.position.copy(hinge.axis).multiplyScalar(position);
      else hinge.link.quaternion.setFromAxisAngle(hinge.axis, position);
    }
    const first = 1 + tile.joints.length;
    shown.free.forEach((mesh, k) => {
      placed(mesh, [0, 1, 2, 3, 4, 5, 6].map((j) => value(tile, first + 7 * k + j, at)));
      mesh.quaternion.normalize();
    });
  }

  // Drawing: each tile in its own part of the canvas, all seen from the same side.
  const background = new THREE.Color();
  function draw() {
    const canvas = renderer.domElement;
    const paper = getComputedStyle(document.body).backgroundColor;
    background.setStyle(paper);
    scene.background = background;
    renderer.setScissorTest(true);
    tracklight.position.copy(camera.position).add(new THREE.Vector3(0.3, 0.2, 0.6));
    const ghost = state.tiles[state.ghost];
    for (const tile of state.tiles) {
      const place = tile.element.getBoundingClientRect();
      if (!place.width || !place.height) continue;
      const bottom = canvas.clientHeight - place.bottom;
      renderer.setViewport(place.left, bottom, place.width, place.height);
      renderer.setScissor(place.left, bottom, place.width, place.height);
      camera.aspect = place.width / place.height;
      camera.updateProjectionMatrix();
      for (const other of state.tiles) {
        other.body.root.visible = other === tile;
        other.shade.root.visible = other === ghost && ghost !== tile;
      }
      pose(tile.body, tile, state.time);
      if (ghost && ghost !== tile) pose(ghost.shade, ghost, state.time);
      renderer.render(scene, camera);
    }
    state.frames += 1;
    canvas.dataset.frames = state.frames;
  }
  function tell() {
    for (const tile of state.tiles) {
      const phase = tile.phases.filter(([began]) => began <= state.time + 1e-9).at(-1);
      const over = state.time > end(tile) + 0.02;
      tile.line.textContent = over ? `ended at ${end(tile).toFixed(2)} s` : phase ? phase[1] : "";
    }
    get("time").value = state.time;
    get("now").textContent = `${state.time.toFixed(2)} / ${Number(get("time").max).toFixed(2)} s`;
  }
  function view() {
    const box = new THREE.Box3();
    for (const { body } of state.tiles) {
      body.root.updateMatrixWorld(true);
      // What moves is what one looks at: a table may be much larger.
      for (const part of [...body.free, ...body.links]) box.union(new THREE.Box3().setFromObject(part));
    }
    if (box.isEmpty()) box.setFromObject(state.tiles[0].body.root);
    const ball = box.getBoundingSphere(new THREE.Sphere());
    const tile = state.tiles[0].element.getBoundingClientRect();
    const narrow = Math.min(1, tile.width / tile.height);
    const half = Math.atan(narrow * Math.tan(((camera.fov / 2) * Math.PI) / 180));
    const away = ball.radius / Math.sin(half); // what is nearer than the centre is in sight too
    const side = new THREE.Vector3(0.35, -1, 0.5).normalize();
    controls.target.copy(ball.center);
    camera.up.set(0, 0, 1);
    camera.position.copy(ball.center).addScaledVector(side, away);
    camera.lookAt(ball.center);
    draw();
  }
  function grid() {
    const count = state.tiles.length;
    const place = get("tiles").getBoundingClientRect();
    let best = [0, 1];
    for (let columns = 1; columns <= count; columns++) {
      const [width, height] = [place.width / columns, place.height / Math.ceil(count / columns)];
      best = [Math.max(best[0], Math.min(width, height * 1.2)), Math.min(width, height * 1.2) > best[0] ? columns : best[1]];
    }
    get("tiles").style.gridTemplateColumns = `repeat(${best[1]}, minmax(0, 1fr))`;
    get("tiles").style.gridAutoRows = "minmax(0, 1fr)";
  }

  function option(text, value) {
    const made = document.createElement("option");
    made.textContent = text;
    made.value = value;
    return made;
  }
  async function choose(number) {
    const group = data.groups[number];
    for (const tile of state.tiles) for (const { root } of [tile.body, tile.shade]) scene.remove(root);
    state.group = number;
    state.ghost = -1;
    await Promise.all(group.tiles.map(unpacked));
    state.tiles = group.tiles;
    get("tiles").replaceChildren();
    for (const tile of state.tiles) {
      tile.body = body(tile, false);
      tile.shade = body(tile, true);
      pose(tile.body, tile, 0);
      tile.element = document.createElement("div");
      tile.element.className = "tile";
      const name = document.createElement("b");
      name.textContent = tile.label;
      const told = document.createElement("span");
      told.textContent = tile.status === "ok" ? "" : `${tile.status} \u00b7 `;
      told.className = "failed";
      tile.line = document.createElement("span");
      tile.element.append(name, told, tile.line);
      get("tiles").append(tile.element);
    }
    get("ghost").replaceChildren(option("none", -1), ...state.tiles.map((t, k) => option(t.label, k)));
    get("group").value = number;
    get("time").max = Math.max(...state.tiles.map(end));
    state.time = 0;
    grid();
    tell();
    view();
  }

  function play(on) {
    state.playing = on;
    state.last = performance.now();
    if (on && state.time >= Number(get("time").max)) state.time = 0;
    get("play").textContent = on ? "Pause" : "Play";
    get("play").setAttribute("aria-pressed", String(on));
    if (on) requestAnimationFrame(advance);
  }
  function advance(now) {
    if (!state.playing) return;
    const passed = Math.max(0, now - state.last) / 1000;
    state.last = now;
    state.time = Math.min(Number(get("time").max), state.time + passed * Number(get("speed").value));
    tell();
    draw();
    if (state.time >= Number(get("time").max)) play(false);
    else requestAnimationFrame(advance);
  }

  // The viewer calls `render` when it has loaded, and when the view or the window changes.
  let begun = false;
  window.render = () => {
    if (!begun) {
      begun = true;
      viewed = scene.children.at(-1);
      viewed.visible = false;
      scene.add(new THREE.HemisphereLight(0xffffff, 0x777777, 0.7));
      tracklight.intensity = 0.7;
      const lines = new THREE.GridHelper(4, 20, 0x999999, 0x999999);
      lines.material.transparent = true;
      lines.material.opacity = 0.35;
      lines.rotation.x = Math.PI / 2;
      scene.add(lines);
      camera.near = 0.01;
      camera.far = 200;
      start();
    } else if (state.tiles.length) {
      camera.up.set(0, 0, 1); // the horizon stays level
      camera.lookAt(controls.target);
      grid();
      draw();
    }
  };
  async function start() {
    data.groups.forEach((group, k) => get("group").append(option(`${group.task}, seed ${group.seed}`, k)));
    const asked = () => Number(location.hash.slice(1)) || 0;
    const valid = (k) => Number.isInteger(k) && data.groups[k] && data.groups[k].tiles.length > 0;
    const go = (k) => choose(valid(k) ? k : data.groups.findIndex((g) => g.tiles.length));
    await go(asked());
    addEventListener("hashchange", () => go(asked()));
    get("group").addEventListener("change", (event) => { location.hash = event.target.value; });
    get("play").addEventListener("click", () => play(!state.playing));
    get("view").addEventListener("click", view);
    get("ghost").addEventListener("change", (event) => { state.ghost = Number(event.target.value); draw(); });
    get("time").addEventListener("input", (event) => { state.time = Number(event.target.value); tell(); draw(); });
    addEventListener("keydown", (event) => {
      if (event.key !== " " || event.target.matches("button, select, input, a")) return;
      event.preventDefault();
      play(!state.playing);
    });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
    document.body.dataset.ready = "yes";
  }
})();
