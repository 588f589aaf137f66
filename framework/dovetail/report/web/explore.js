"use strict";
/* The explorer's page: a slider and a number field a parameter; each input is a request, and the newest one wins. */
(async function () {
  const { FrfChart, drawModes, element, number } = DovetailCharts;
  const PAUSE = 80;  /* ms */
  const SHOWN_MARK = { good: "\u2713", rough: "\u2248", bad: "\u2717", open: "?" };
  const byId = (id) => document.getElementById(id);
  const origin = await (await fetch("start")).json();
  const { parameters } = origin;

  let values = parameters.map((parameter) => parameter.value);
  let past = [], future = [], settled = values.slice();
  let response = 0, chart = null, fitted = null, fitting = false;
  const rows = [];

  /* Parts of a range, on the parameter's own scale. */
  const toPart = (parameter, value) => parameter.scale === "log"
    ? Math.log(value / parameter.lower) / Math.log(parameter.upper / parameter.lower)
    : (value - parameter.lower) / (parameter.upper - parameter.lower);
  const fromPart = (parameter, part) => parameter.scale === "log"
    ? parameter.lower * (parameter.upper / parameter.lower) ** part
    : parameter.lower + part * (parameter.upper - parameter.lower);
  const inRange = (parameter, value) => Math.min(Math.max(value, parameter.lower), parameter.upper);
  const shown = (parameter, value) => String(Number((value * parameter.factor).toPrecision(5)));

  async function ask(path, content) {
    const answer = await fetch(path, { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(content) });
    if (!answer.ok) {
      const kind = answer.headers.get("Content-Type") || "";
      throw new Error(kind.startsWith("application/json") ? (await answer.json()).error : `The program answered ${answer.status}.`);
    }
    return answer;
  }

  function say(text, mark = "") {
    byId("status").textContent = text;
    byId("status").className = `status verdict ${mark}`;
  }

  /* One request at a time; what was put in meanwhile is asked next, the newest alone. */
  let asking = false, waiting = null, pausing = null;
  async function follow(began) {
    waiting = { began: began ?? performance.now() };
    if (asking) return;
    asking = true;
    while (waiting) {
      byId("modes").drawing = 0;  // stand still until the hand rests
      const { began: start } = waiting;
      waiting = null;
      try {
        const asked = response;
        const answer = await (await ask("frf", { values, response: asked })).json();
        if (asked !== response) continue;
        chart.onDrawn = () => { chart.onDrawn = null; performance.measure("input to curve", { start, end: performance.now() }); };
        chart.show("model", { label: "model", amplitude: answer.amplitude, phase: answer.phase, residual: answer.residual });
        showMisfit(answer);
        clearTimeout(pausing);
        pausing = setTimeout(showModes, PAUSE);
      } catch (error) {
        say(error.message, "bad");
      }
    }
    asking = false;
  }

  /* Natural frequencies take longer than a curve, so they follow when the hand rests. */
  async function showModes() {
    let natural = [], shapes = [];
    try { ({ natural, shapes } = await (await ask("modes", { values })).json()); } catch { return; }
    chart.showNatural(natural);
    byId("modes").hidden = !shapes.length;
    if (shapes.length) drawModes(byId("modes"), shapes);
    figure("natural", "Natural frequencies", natural.length ? `${natural.map((value) => value.toFixed(1)).join(", ")} Hz` : "\u2013");
  }

  function showMisfit(answer) {
    if (answer.misfit == null) return;
    figure("misfit", "Misfit", `${number(answer.misfit, 3)} dB`);
    figure("noises", "Residual", `${number(answer.noises, 3)} \u00d7 noise`);
    figure("agreement", "Agreement", number(answer.coherence, 3));
  }

  function figure(id, name, text) {
    const shownAt = byId(id) ?? byId("figures").appendChild(element("div", { id }, element("dt", {}, name), element("dd", {})));
    shownAt.lastChild.textContent = text;
  }

  function makeRow(parameter, index) {
    const name = `parameter-${index}`;
    const slider = element("input", { type: "range", min: "0", max: "1", step: "0.0005", "aria-label": `${parameter.name}, slider` });
    const field = element("input", { type: "number", id: name, step: "any", "aria-describedby": `${name}-about` });
    const lock = element("input", { type: "checkbox", "aria-label": `Lock ${parameter.name}` });
    const interval = element("span", {});
    const track = element("div", { class: "interval", hidden: "" }, interval);
    const ends = `${shown(parameter, parameter.lower)} to ${shown(parameter, parameter.upper)} ${parameter.unit}${parameter.scale === "log" ? ", log" : ""}`;
    const about = element("span", {}, parameter.description), shownRange = element("span", {}, ends);
    slider.addEventListener("input", (event) => { put(index, fromPart(parameter, Number(slider.value)), event.timeStamp); });
    slider.addEventListener("change", settle);
    field.addEventListener("change", (event) => {
      const value = Number(field.value) / parameter.factor;
      if (field.value !== "" && Number.isFinite(value)) {
        if (value !== inRange(parameter, value)) say(`${parameter.name} stays within its range, ${ends}.`);
        put(index, inRange(parameter, value), event.timeStamp);
      }
      showValues();
      settle();
    });
    lock.addEventListener("change", () => { slider.disabled = field.disabled = lock.checked; });
    rows.push({ slider, field, lock, interval, track, shownRange, ends });
    return element("div", { class: "parameter" },
      element("div", { class: "line" }, element("label", { class: "name", for: name }, parameter.name), field, element("span", { class: "unit" }, parameter.unit), element("label", { class: "lock" }, lock, "lock")),
      slider, track, element("div", { class: "about", id: `${name}-about` }, about, shownRange));
  }

  function put(index, value, began) {
    values[index] = value;
    showValues(index);
    follow(began);
  }

  function showValues(only = null) {
    parameters.forEach((parameter, index) => {
      if (only !== null && only !== index) return;
      const { slider, field } = rows[index];
      if (document.activeElement !== slider || only === null) slider.value = toPart(parameter, values[index]);
      field.value = shown(parameter, values[index]);
      slider.setAttribute("aria-valuetext", `${field.value} ${parameter.unit}`);
    });
    byId("undo").disabled = !past.length;
    byId("redo").disabled = !future.length;
  }

  /* The end of an input: a step that can be undone. */
  function settle() {
    if (values.every((value, index) => value === settled[index])) return;
    past.push(settled);
    future = [];
    settled = values.slice();
    showValues();
  }

  function step(from, to) {
    if (!from.length) return;
    to.push(values.slice());
    values = from.pop();
    settled = values.slice();
    showValues();
    follow();
  }

  function take(taken) {
    values = taken;
    showValues();
    settle();
    return follow();
  }

  function showIntervals(answer) {
    parameters.forEach((parameter, index) => {
      const { interval, track, shownRange, ends } = rows[index];
      const bounds = answer && answer.intervals[parameter.name];
      track.hidden = !bounds;
      shownRange.textContent = ends;
      if (!bounds) return;
      const [low, high] = bounds.map((value) => Math.min(Math.max(toPart(parameter, value), 0), 1));
      interval.style.left = `${100 * low}%`;
      interval.style.width = `${100 * (high - low)}%`;
      const precision = answer.precisions[parameter.name];
      const range = `90 %: ${shown(parameter, bounds[0])} to ${shown(parameter, bounds[1])} ${parameter.unit}; ${precision}${precision ? ", " : ""}`;
      const flag = answer.outside.includes(parameter.name) ? [element("span", { class: "flag" }, "best fit outside")] : [];
      shownRange.replaceChildren(range, element("span", { class: `verdict ${answer.marks[parameter.name]}` }, answer.verdicts[parameter.name]), ...flag);
    });
  }

  function enable(active) {
    fitting = !active;
    for (const control of document.querySelectorAll("#controls button, #controls input, #controls select")) control.disabled = !active;
    rows.forEach(({ slider, field, lock }) => { slider.disabled = field.disabled = !active || lock.checked; });
    if (active) showValues();
    for (const control of [byId("fit"), document.querySelector("[data-save='html']")]) control.disabled = !active || !origin.measured;
  }

  async function fit() {
    enable(false);
    say("Fitting.");
    try {
      const locked = parameters.filter((parameter, index) => rows[index].lock.checked).map((parameter) => parameter.name);
      const answer = await (await ask("fit", { values, locked })).json();
      const clipped = answer.values.map((value, index) => inRange(parameters[index], value));
      fitted = { answer, values: clipped };
      await take(clipped.slice());
      showIntervals(answer);
      say([`${SHOWN_MARK[answer.mark]} ${answer.verdict}`, answer.explanation, ...answer.warnings].filter(Boolean).join(" "), answer.mark);
    } catch (error) {
      say(error.message, "bad");
    }
    enable(true);
  }

  async function save(kind) {
    try {
      const same = fitted !== null && fitted.values.every((value, index) => value === values[index]);
      if (kind === "html") say("Writing the report.");
      const file = await (await ask("save", { kind, values, fit: same ? fitted.answer.fit : null })).blob();
      const link = element("a", { href: URL.createObjectURL(file), download: `${origin.name.replace(/[^\w-]+/g, "_")}.${kind}` });
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 10000);
      say(`Saved: ${link.download}, ${same ? "as fitted" : "parameters chosen by hand"}.`);
    } catch (error) {
      say(error.message, "bad");
    }
  }

  function keep() {
    const button = byId("keep");
    const kept = button.getAttribute("aria-pressed") === "true";
    button.setAttribute("aria-pressed", String(!kept));
    button.textContent = kept ? "Keep curve" : "Drop kept curve";
    if (kept) { chart.hide("before"); return; }
    ask("frf", { values, response }).then((answer) => answer.json()).then((answer) => chart.show("before", { label: "kept", amplitude: answer.amplitude, phase: answer.phase }));
  }

  function choose(index) {
    response = index;
    chart = new FrfChart(byId("chart"), origin.charts[index]);
    byId("keep").setAttribute("aria-pressed", "false");
    byId("keep").textContent = "Keep curve";
    return follow();
  }

  /* The connection by which program and page notice when the other ends. */
  function stayInTouch() {
    const line = new EventSource("alive");
    let lost = null;
    line.onmessage = (event) => {
      clearTimeout(lost);
      lost = null;
      const progress = JSON.parse(event.data);
      if (fitting) say(progress ? `Fitting: ${progress}.` : "Fitting.");
    };
    line.onerror = () => {
      lost = lost ?? setTimeout(() => {
        byId("over").textContent = "The program has ended. This page can be closed.";
        byId("over").hidden = false;
        line.close();
      }, 2500);
    };
    window.addEventListener("pagehide", () => line.close());
  }

  const top = document.querySelector(".top");
  new ResizeObserver(() => document.documentElement.style.setProperty("--top", `${top.offsetHeight}px`)).observe(top);
  byId("parameters").append(...parameters.map(makeRow));
  byId("fit").addEventListener("click", fit);
  byId("undo").addEventListener("click", () => step(past, future));
  byId("redo").addEventListener("click", () => step(future, past));
  byId("reset").addEventListener("click", () => take(parameters.map((parameter, index) => (rows[index].lock.checked ? values[index] : parameter.value))));
  byId("keep").addEventListener("click", keep);
  for (const button of document.querySelectorAll("[data-save]")) button.addEventListener("click", () => save(button.dataset.save));
  document.addEventListener("keydown", (event) => {
    if (!(event.ctrlKey || event.metaKey) || fitting) return;
    const action = { z: () => step(past, future), y: () => step(future, past) }[event.key];
    if (action) { event.preventDefault(); action(); }
  });
  if (origin.responses.length > 1) {
    byId("response").append(...origin.responses.map((label, index) => element("option", { value: String(index) }, label)));
    byId("response").hidden = false;
    byId("response").addEventListener("change", (event) => choose(Number(event.target.value)));
  }
  stayInTouch();
  enable(true);
  await choose(0);
  say(origin.measured ? "Move a slider, or fit from here." : "Move a slider.");
  document.documentElement.dataset.ready = "true";
})();
