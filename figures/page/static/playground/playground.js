// Two samplers beside each other on a scene, rendered here: images, differences, spectra, errors over samples.
const FILTER_NAMES = { none: "none", gaussian: "Gaussian, 1.5 pixels", eye: "eye, from 2000 pixels" };
const EXACT = "exact"; // the exact image in place of a sampler
const ENOUGH = 14; // milliseconds of the graphics card at a time, so that pages stay alive
const OFTEN = 150; // milliseconds between pictures
const SIDES = ["left", "right"];

// What is shown, from the address or at first.
const choices = (data) => {
  const samplers = [...data.samplers.map((each) => each.id), EXACT];
  const allowed = {
    left: samplers, right: samplers, scene: data.scenes.map((each) => each.id), spp: data.counts, key: data.keys,
    filter: Object.keys(FILTER_NAMES), view: Object.keys(modes),
  };
  const first = { left: samplers[0], right: samplers[1], scene: allowed.scene[0], spp: data.counts[0], key: data.keys[0],
    filter: "none", view: "file", ...data.start };
  const ofAddress = () => {
    const asked = new URLSearchParams(location.hash.slice(1));
    return Object.fromEntries(Object.entries(allowed).map(([name, values]) => [
      name, values.find((value) => String(value) === asked.get(name)) ?? first[name]]));
  };
  const address = (choice) => `#${new URLSearchParams(choice)}`;
  return { allowed, ofAddress, address };
};

// Render both sides, samples in their order; tell of what is finished and what fails.
const renderer = (accumulate, measure, told) => {
  const jobs = [null, null];
  let [batch, wake] = [1, null];
  const done = (job) => job.count >= job.spp || job.failed;
  const next = () => jobs.filter((job) => job && !done(job)).sort((a, b) => a.count - b.count)[0];
  const current = (job) => jobs[job.at] === job;

  const advance = async (job) => {
    // Errors are measured at powers of two.
    const goal = Math.min(job.spp, 2 ** Math.floor(Math.log2(Math.max(1, job.count)) + (job.count ? 1 : 0)));
    const last = Math.min(goal, job.count + batch);
    await accumulate("compile", job.program);
    if (!current(job)) return;
    const reading = last === goal || performance.now() - job.shown > OFTEN;
    const given = { at: job.at, program: job.program, first: job.count, last, reading };
    const { sums, took } = await accumulate("add", given);
    if (took > 2 * ENOUGH) batch = Math.max(1, batch >> 1);
    else if (took < ENOUGH) batch *= 2;
    if (!current(job)) return;
    job.count = last;
    if (!reading) return;
    const errors = await measure("measure", { at: job.at, sums, count: last });
    if (!current(job)) return;
    job.shown = performance.now();
    job.errors = errors;
    if (last === goal) job.curve.push([last, errors]);
    told(job);
  };
  const run = async () => {
    for (;;) {
      const job = next();
      if (!job) { await new Promise((resolve) => { wake = resolve; }); continue; }
      try {
        await advance(job);
      } catch (error) {
        if (error.message === "lost") {
          told(null);
          await accumulate("restored");
          for (const each of jobs) if (each && !done(each)) Object.assign(each, { count: 0, curve: [] });
        } else {
          Object.assign(job, { failed: error.message, broken: true });
          told(job);
        }
      }
    }
  };
  run();
  return {
    jobs,
    // Begin a side anew, from the first sample.
    begin: (at, program, spp) => {
      const failed = typeof program === "string" ? program : "";
      jobs[at] = { at, program, spp, count: 0, curve: [], shown: 0, failed };
      if (failed) measure("forget", at).then(() => told(jobs[at]));
      wake?.();
    },
    // The exact image has no samples.
    exact: async (at) => {
      const job = jobs[at] = { at, spp: 0, count: 0, curve: [] };
      job.errors = await measure("measure", { at, sums: null, count: 1 });
      if (current(job)) told(job);
    },
  };
};

const playground = async (root) => {
  const [live, still] = [root.querySelector(".live"), root.querySelector(".still")];
  const loading = root.querySelector(".loading");
  loading.hidden = false;
  const data = await unpacked(window.playgroundData);
  const [accumulate, measure] = [accumulating, measuring].map(asker);
  if (!await accumulate("open", data.side)) { loading.hidden = true; return; }
  const { allowed, ofAddress, address } = choices(data);
  const choice = ofAddress();
  const { side } = data;

  const select = (name, label, options) => element("label", { className: name }, label, element("select", {
    name, onchange: (event) => change(name, event.target.value),
  }, ...options.map(([value, words]) => element("option", { value }, words))));
  const ofSamplers = [...data.samplers.map(({ id, name }) => [id, name]), [EXACT, "exact image"]];
  const controls = element("div", { className: "controls" },
    select("left", "Left", ofSamplers), select("right", "Right", ofSamplers),
    select("scene", "Scene", data.scenes.map(({ id, name }) => [id, name])),
    select("key", "Key", data.keys.map((key) => [key, String(key)])),
    select("filter", "Filter", Object.entries(FILTER_NAMES)),
    choiceOfCount(data.counts, data.counts.indexOf(choice.spp), (spp) => change("spp", spp)),
    choiceOfModes((view) => change("view", view)));
  const canvases = SIDES.map((name) => element("canvas", { className: name, width: side, height: side, role: "img" }));
  const line = element("div", { className: "line" });
  const split = element("input", { type: "range", className: "split", min: 0, max: side, step: 1, value: side / 2,
    "aria-label": "Split between the images: arrow keys move it" });
  canvases[0].classList.add("over");
  const captions = SIDES.map((name) => element("span", { className: `caption ${name}` }));
  const stage = element("div", { className: "stage" }, canvases[1], canvases[0], line, split, ...captions);
  const legend = element("ul", { className: "legend" });
  const plot = drawing("svg", { role: "img", "aria-label": "Errors over samples per pixel" });
  const note = element("p", { className: "stage-note", role: "status" });
  live.append(stage, element("div", { className: "beside" }, controls, legend, element("div", { className: "plot" }, plot)), note);

  const divide = () => {
    const part = (100 * split.value) / side;
    canvases[0].style.clipPath = `inset(0 ${100 - part}% 0 0)`;
    line.style.left = `${part}%`;
    split.setAttribute("aria-valuetext", `${Math.round(part)} % ${nameOf("left")}, the rest ${nameOf("right")}`);
  };
  const nameOf = (name) => ofSamplers.find(([id]) => id === choice[name])[1];
  const draw = () => {
    const box = plot.getBoundingClientRect();
    const [width, height] = [box.width || 400, box.height || 240];
    const lines = SIDES.map((name, at) => [name, (rendering.jobs[at]?.curve ?? [])
      .map(([count, errors]) => [count, errors[choice.filter]])]);
    plot.setAttribute("viewBox", `0 0 ${width} ${height}`);
    plot.replaceChildren(...curve(lines, choice.spp, width, height));
    SIDES.forEach((name, at) => { captions[at].textContent = nameOf(name); });
    legend.replaceChildren(...SIDES.map((name, at) => {
      const job = rendering.jobs[at];
      const words = job?.failed ? job.failed
        : choice[name] === EXACT ? "" : job?.errors ? `${job.count} spp, error ${error({ rms: job.errors[choice.filter] })}`
          : "compiling …";
      return element("li", { className: name }, element("b", {}, nameOf(name)), " ", element("span", {}, words));
    }));
    const finished = rendering.jobs.every((job) => job && (job.failed || (job.errors && job.count >= job.spp)));
    live.dataset.state = finished ? "finished" : "rendering";
  };
  let [showing, again] = [false, false];
  const show = async () => {
    again = true;
    if (showing) return;
    showing = true;
    while (again) {
      again = false;
      const { pictures, scale, view, filter } = await measure("show", { view: choice.view, filter: choice.filter });
      pictures.forEach((greys, at) => {
        const context = canvases[at].getContext("2d");
        if (rendering.jobs[at].failed) context.clearRect(0, 0, side, side);
        else if (greys) context.putImageData(new ImageData(greys, side, side), 0, 0);
        canvases[at].setAttribute("aria-label", `${modes[view]} of ${nameOf(SIDES[at])}`);
      });
      const words = explained(view, { scale });
      const scene = data.scenes.find(({ id }) => id === choice.scene).name;
      note.textContent = `The scene “${scene}” at ${choice.spp} spp, ${side} x ${side} pixels: drag the line. ${words}${words && ". "}`
        + (filter === "none" ? "" : "Errors are those after the filter. ")
        + "Errors are root mean squares (RMS) of the difference from the exact image, after the first samples of each pixel.";
      // Where shaders do not compile, the pictures stay.
      const ready = pictures.every((greys, at) => greys || rendering.jobs[at].failed);
      if (ready) loading.hidden = true;
      if (live.hidden && ready && !rendering.jobs.every((job) => job.broken)) {
        live.hidden = false;
        still.hidden = true;
        layout();
        performance.mark("playground");
      }
      draw();
    }
    showing = false;
  };
  const told = (job) => {
    if (job === null) { note.textContent = "The browser has lost the graphics card; rendering goes on when it is back."; return; }
    show();
  };
  const rendering = renderer(accumulate, measure, told);
  const begin = (at) => {
    const sampler = choice[SIDES[at]];
    if (sampler === EXACT) rendering.exact(at);
    else rendering.begin(at, programOf(data, sampler, choice.scene, choice.spp, choice.key), choice.spp);
  };
  const beginScene = () => {
    measure("start", { side, reference: data.scenes.find((scene) => scene.id === choice.scene).reference });
    SIDES.forEach((_, at) => begin(at));
  };
  const change = (name, value) => {
    const chosen = allowed[name].find((each) => String(each) === String(value));
    if (chosen === choice[name]) return;
    choice[name] = chosen;
    history.replaceState(null, "", address(choice));
    if (name === "scene") beginScene();
    else if (SIDES.includes(name)) begin(SIDES.indexOf(name));
    else if (name === "spp" || name === "key") SIDES.forEach((_, at) => begin(at));
    else show();
    divide();
    draw();
  };
  const fill = () => {
    for (const each of controls.querySelectorAll("select")) each.value = choice[each.name];
    controls.querySelector(".spp").value = data.counts.indexOf(choice.spp);
    controls.querySelector(".spp").dispatchEvent(new Event("input"));
    controls.querySelector(`[value="${choice.view}"]`).checked = true;
  };
  const layout = () => {
    const zoom = pixels.fitting(side, Math.min(STAGE, root.clientWidth));
    for (const canvas of canvases) canvas.style.width = canvas.style.height = pixels.css(side, zoom);
    draw();
  };
  addEventListener("hashchange", () => {
    if (!location.hash.includes("left=")) return;
    const asked = ofAddress();
    for (const name of Object.keys(asked)) change(name, asked[name]);
    fill();
  });
  split.addEventListener("input", divide);
  layouts.push(layout);
  fill();
  divide();
  beginScene();
};

for (const root of document.querySelectorAll(".playground")) {
  const parts = ["DecompressionStream", "OffscreenCanvas", "playgroundData"];
  if (!parts.every((part) => part in window)) continue; // The pictures stay.
  new IntersectionObserver((entries, observer) => {
    if (!entries.some((entry) => entry.isIntersecting)) return;
    observer.disconnect();
    playground(root);
  }, { rootMargin: "400px" }).observe(root);
}
