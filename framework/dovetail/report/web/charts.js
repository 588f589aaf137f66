"use strict";
/* FRFs as charts that answer: amplitude, phase, and residual or coherence on uPlot, linked in zoom and cursor.

   new DovetailCharts.FrfChart(host, data): data as `dovetail.report.charts.chart_data` makes it. Both the report and the explorer use it. */
var DovetailCharts = (function () {
  const HEIGHT = { amplitude: 250, phase: 130, coherence: 110, residual: 130 };
  const AXIS = 66;
  const TABLE_ROWS = 60;
  const STYLE = {
    measured: { width: 2.6, colour: "--measured" },
    model: { width: 1.4, colour: "--model" },
    before: { width: 1.2, colour: "--before", dash: [6, 4] },
  };
  /* Methods have seven colours; those beyond are dashed. */
  const COLOURS = 7;
  const coloured = (role) => role.replace(/\d+/, (count) => count % COLOURS);
  const styleOf = (role) => STYLE[role] || { width: 1.3, colour: `--${coloured(role)}`, dash: coloured(role) === role ? undefined : [5, 3] };
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const charts = [];

  /* Numbers that came as base64 of little-endian 32-bit floats; what is not finite is a gap. */
  function decode(text) {
    const bytes = Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
    return Array.from(new Float32Array(bytes.buffer), (value) => (Number.isFinite(value) ? value : null));
  }

  function element(name, attributes, ...children) {
    const made = document.createElement(name);
    for (const [key, value] of Object.entries(attributes || {})) {
      if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
      else made.setAttribute(key, value);
    }
    made.append(...children);
    return made;
  }

  function colour(name) {
    return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  }

  const SUPERSCRIPT = { "-": "\u207b", 0: "\u2070", 1: "\u00b9", 2: "\u00b2", 3: "\u00b3", 4: "\u2074", 5: "\u2075", 6: "\u2076", 7: "\u2077", 8: "\u2078", 9: "\u2079" };

  /* A number with significant digits; powers of ten as they are written. */
  function number(value, digits) {
    if (value == null || !Number.isFinite(value)) return "\u2013";
    const size = Math.abs(value);
    if (value === 0 || (size >= 1e-3 && size < 1e6)) {
      const text = value.toPrecision(digits);
      return (text.includes("e") ? String(Math.round(value)) : text).replace("-", "\u2212");
    }
    const [mantissa, power] = value.toExponential(digits - 1).split("e");
    const raised = String(Number(power)).replace(/./g, (sign) => SUPERSCRIPT[sign]);
    return `${mantissa.replace("-", "\u2212")} \u00d7 10${raised}`;
  }

  function decade(value) {
    const power = Math.round(Math.log10(value));
    if (Math.abs(Math.log10(value) - power) > 1e-6 || (power >= -2 && power <= 4)) return String(Number(value.toPrecision(3)));
    return "10" + String(power).replace(/./g, (sign) => SUPERSCRIPT[sign]);
  }

  /* Phase in degrees within 180 of a centre, cut where it jumps from one side to the other. */
  function wrapped(phase, centre) {
    const turned = phase.map((value) => (value == null ? null : ((((value - centre + 180) % 360) + 360) % 360) - 180 + centre));
    for (let line = turned.length - 1; line > 0; line--) {
      if (turned[line] != null && turned[line - 1] != null && Math.abs(turned[line] - turned[line - 1]) > 180) turned[line] = null;
    }
    return turned;
  }

  class FrfChart {
    constructor(host, data) {
      this.host = host;
      this.data = data;
      this.frequency = decode(data.frequency);
      this.curves = data.curves.map((curve) => this.decoded(curve));
      this.natural = data.natural || [];
      this.bands = data.bands || [];
      this.logarithmic = false;
      this.range = [this.frequency[0], this.frequency[this.frequency.length - 1]];
      this.plots = [];
      this.frame();
      this.build();
      new ResizeObserver(() => this.fit()).observe(this.panels);
      charts.push(this);
    }

    decoded(curve) {
      const amplitude = decode(curve.amplitude).map((value) => (value > 0 ? value : null));
      return { label: curve.label, role: curve.role, amplitude, phase: curve.phase ? wrapped(decode(curve.phase), this.data.centre) : null, coherence: curve.coherence ? decode(curve.coherence) : null, residual: curve.residual ? decode(curve.residual).map((value) => (value > 0 ? value : null)) : null };
    }

    /* What surrounds the panels: legend, buttons, what the pointer reads, the table. */
    frame() {
      const button = (text, title, action) => element("button", { type: "button", title, "aria-label": title, onclick: action }, text);
      this.logButton = button("log f", "log f: logarithmic frequency axis", () => this.toggleLogarithmic());
      this.logButton.setAttribute("aria-pressed", "false");
      const buttons = element("div", { class: "chart-buttons" },
        button("\u2212", "Zoom out", () => this.zoomBy(2)), button("+", "Zoom in", () => this.zoomBy(0.5)),
        button("\u2190", "Move to lower frequencies", () => this.pan(-0.25)), button("\u2192", "Move to higher frequencies", () => this.pan(0.25)),
        button("all", "all frequencies", () => this.reset()), this.logButton);
      this.legend = element("div", { class: "chart-legend" });
      this.readout = element("p", { class: "chart-readout", "aria-live": "polite" });
      this.panels = element("div", {
        class: "chart-panels", tabindex: "0", role: "group",
        "aria-label": `${this.data.title}. Arrow keys move the cursor, plus and minus zoom, n goes to the next natural frequency, 0 shows all.`,
        onkeydown: (event) => this.key(event),
      });
      this.table = element("div", { class: "chart-table", tabindex: "0", role: "region", "aria-label": "Values as a table" });
      this.details = element("details", { class: "chart-values", ontoggle: () => this.fillTable() }, element("summary", {}, "Values as a table"), this.table);
      this.host.replaceChildren(element("div", { class: "chart-head" }, this.legend, buttons), this.panels, this.readout, this.details);
      this.nameCurves();
      this.read(null);
    }

    nameCurves() {
      this.legend.replaceChildren(...this.curves.map((curve) => element("span", { class: `key key-${coloured(curve.role)}` }, curve.label)));
    }

    kinds() {
      const phase = this.curves.some((curve) => curve.phase) ? ["phase"] : [];
      const compared = ["residual", "coherence"].filter((kind) => this.curves.some((curve) => curve[kind]));
      return ["amplitude", ...phase, ...compared];
    }

    columns(kind) {
      const empty = () => new Array(this.frequency.length).fill(null);
      return [this.frequency, ...this.curves.map((curve) => curve[kind] || empty())];
    }

    build() {
      this.plots.forEach((plot) => plot.destroy());
      const kinds = this.kinds();
      this.plots = [];
      this.plots = kinds.map((kind, row) => new uPlot(this.options(kind, row === 0, row === kinds.length - 1), this.columns(kind), this.panels));
      this.zoom(...this.range);
    }

    options(kind, first, last) {
      const styled = (role) => ({ stroke: () => colour(styleOf(role).colour), width: styleOf(role).width, dash: styleOf(role).dash, points: { show: false }, spanGaps: false });
      const series = this.curves.map((curve) => styled(curve.role));
      const axis = { stroke: () => colour("--ink"), grid: { stroke: () => colour("--grid"), width: 1 }, ticks: { show: false }, font: "12px system-ui, sans-serif", labelFont: "12px system-ui, sans-serif" };
      const across = { ...axis, size: last ? 34 : 8, label: last ? "Frequency [Hz]" : null, labelSize: 20, values: (plot, splits) => splits.map((value) => (last && value != null ? String(value) : "")) };
      const x = { time: false, distr: this.logarithmic ? 3 : 1 };
      return {
        width: this.width(), height: this.height(kind, first, last), series: [{}, ...series], legend: { show: false },
        scales: { x, y: this.vertical(kind) }, axes: [across, { ...axis, size: AXIS, label: this.label(kind), labelSize: 20, ...this.ticks(kind) }],
        padding: [first ? 20 : 6, 24, 0, 0],
        cursor: { sync: { key: this.syncKey(), setSeries: false }, drag: { x: true, y: false, dist: 4 }, y: false, points: { show: kind === "amplitude" || kind === "phase", size: 7 } },
        hooks: {
          drawClear: [(plot) => this.drawBands(plot)], draw: [(plot) => this.drawNatural(plot, first), (plot) => kind === "residual" && this.drawNoise(plot), () => last && this.drawn()],
          setCursor: [(plot) => first && this.read(plot.cursor.idx)], setScale: [(plot, scale) => scale === "x" && this.follow(plot)],
        },
      };
    }

    syncKey() {
      this.sync = this.sync || `chart-${charts.length}`;
      return this.sync;
    }

    label(kind) {
      return { amplitude: `${this.data.quantity} [${this.data.unit}]`, phase: "Phase [\u00b0]", coherence: "Agreement [-]", residual: "Residual / noise" }[kind];
    }

    vertical(kind) {
      if (kind === "coherence") return { range: () => [0, 1.03] };
      if (kind === "phase") return { range: () => this.phaseRange() };
      if (kind === "residual") return { distr: 3, range: (plot, low, high) => [0.1, 10 ** Math.max(1, Math.ceil(Math.log10(high ?? 1)))] };
      return { distr: 3 };
    }

    ticks(kind) {
      if (kind === "coherence") return { splits: () => [0, 0.5, 1] };
      if (kind === "residual") {
        const decades = (plot) => {
          const most = Math.round(Math.log10(plot.scales.y.max)), step = Math.ceil((most + 1) / 4);
          return Array.from({ length: most + 1 }, (_, power) => power).filter((power) => power % step === 0).map((power) => 10 ** power);
        };
        return { splits: decades, filter: (plot, splits) => splits, values: (plot, splits) => splits.map(decade) };
      }
      if (kind === "amplitude") return { values: (plot, splits) => splits.map((value) => (value == null ? "" : decade(value))) };
      return { splits: () => { const [low, high] = this.phaseRange(); return [-270, -180, -90, 0, 90, 180, 270].filter((value) => value >= low && value <= high); } };
    }

    phaseRange() {
      const centre = this.data.centre;
      const passive = this.curves.every((curve) => !curve.phase || curve.phase.every((value) => value == null || Math.abs(value - centre) <= 110));
      return passive ? [centre - 110, centre + 110] : [centre - 180, centre + 180];
    }

    width() {
      return Math.max(240, this.panels.clientWidth || 640);
    }

    height(kind, first, last) {
      const tall = document.documentElement.classList.contains("printing") ? 0.58 : this.width() < 500 ? 0.85 : this.width() > 750 ? 1.15 : 1;
      return Math.round(HEIGHT[kind] * tall) + (first ? 14 : 0) + (last ? 30 : 0);
    }

    fit() {
      const kinds = this.kinds();
      this.plots.forEach((plot, row) => {
        const size = { width: this.width(), height: this.height(kinds[row], row === 0, row === kinds.length - 1) };
        if (size.width !== plot.width || size.height !== plot.height) plot.setSize(size);
      });
    }

    /* Put other values into the curve of a role, or add one. */
    show(role, curve) {
      const made = { ...this.decoded(curve), role };
      const place = this.curves.findIndex((known) => known.role === role);
      if (place < 0) {
        this.curves.push(made);
        this.nameCurves();
        this.build();
        return;
      }
      this.curves[place] = made;
      const [min, max] = this.range;
      this.kinds().forEach((kind, row) => this.plots[row].batch((plot) => { plot.setData(this.columns(kind), false); plot.setScale("x", { min, max }); }));
      if (this.details.open) this.fillTable();
    }

    hide(role) {
      const kept = this.curves.filter((curve) => curve.role !== role);
      if (kept.length === this.curves.length) return;
      this.curves = kept;
      this.nameCurves();
      this.build();
    }

    showNatural(frequencies) {
      this.natural = frequencies;
      this.plots.forEach((plot) => plot.redraw(false));
    }

    drawn() {
      if (this.onDrawn) this.onDrawn();
    }

    /* Keep the other panels at the frequencies of the one that was zoomed. */
    follow(plot) {
      const { min, max } = plot.scales.x;
      if (min == null || !this.plots.includes(plot)) return;
      this.range = [min, max];
      this.plots.forEach((other) => { if (other.scales.x.min !== min || other.scales.x.max !== max) other.setScale("x", { min, max }); });
      if (this.details.open) this.fillTable();
    }

    zoom(low, high) {
      const [first, last] = [this.frequency[0], this.frequency[this.frequency.length - 1]];
      const width = Math.min(Math.max(high - low, (last - first) / 2000), last - first);
      const min = Math.min(Math.max(low, first), last - width);
      this.plots.forEach((plot) => plot.setScale("x", { min, max: min + width }));
    }

    zoomBy(factor) {
      const [low, high] = this.range;
      const at = this.cursor == null ? (low + high) / 2 : Math.min(Math.max(this.frequency[this.cursor], low), high);
      this.zoom(at - (at - low) * factor, at + (high - at) * factor);
    }

    pan(part) {
      const [low, high] = this.range;
      this.zoom(low + part * (high - low), high + part * (high - low));
    }

    reset() {
      this.zoom(this.frequency[0], this.frequency[this.frequency.length - 1]);
    }

    toggleLogarithmic() {
      this.logarithmic = !this.logarithmic;
      this.logButton.setAttribute("aria-pressed", String(this.logarithmic));
      this.build();
    }

    key(event) {
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      const step = event.shiftKey ? 20 : 1;
      const actions = {
        ArrowRight: () => this.moveTo((this.cursor ?? this.middle()) + step), ArrowLeft: () => this.moveTo((this.cursor ?? this.middle()) - step),
        Home: () => this.moveTo(this.nearest(this.range[0])), End: () => this.moveTo(this.nearest(this.range[1])),
        "+": () => this.zoomBy(0.5), "=": () => this.zoomBy(0.5), "-": () => this.zoomBy(2), "0": () => this.reset(), Escape: () => this.reset(),
        n: () => this.nextNatural(), l: () => this.toggleLogarithmic(),
      };
      if (!actions[event.key]) return;
      event.preventDefault();
      actions[event.key]();
    }

    middle() {
      return this.nearest((this.range[0] + this.range[1]) / 2);
    }

    nearest(frequency) {
      let low = 0, high = this.frequency.length - 1;
      while (high - low > 1) {
        const centre = (low + high) >> 1;
        if (this.frequency[centre] < frequency) low = centre; else high = centre;
      }
      return frequency - this.frequency[low] < this.frequency[high] - frequency ? low : high;
    }

    nextNatural() {
      const at = this.cursor == null ? -Infinity : this.frequency[this.cursor];
      const sorted = [...this.natural].sort((one, other) => one - other);
      const next = sorted.find((frequency) => this.nearest(frequency) > (this.cursor ?? -1) && frequency > at) ?? sorted[0];
      if (next != null) this.moveTo(this.nearest(next));
    }

    moveTo(line) {
      const at = Math.min(Math.max(line, 0), this.frequency.length - 1);
      const frequency = this.frequency[at];
      const [low, high] = this.range;
      if (frequency < low || frequency > high) this.zoom(frequency - (high - low) / 2, frequency + (high - low) / 2);
      queueMicrotask(() => {
        this.plots.forEach((plot) => plot.setCursor({ left: plot.valToPos(frequency, "x"), top: 20 }, true, false));
        this.read(at);
      });
    }

    /* Say what the curves have at a line. */
    read(line) {
      this.cursor = line;
      if (line == null) {
        this.readout.textContent = "Point at the chart to read values; drag to zoom in, double-click to see all.";
        return;
      }
      const words = this.curves.map((curve) => {
        const angle = curve.phase && curve.phase[line] != null ? ` \u2220 ${number(curve.phase[line], 4)}\u00b0` : "";
        const agreement = curve.coherence ? `, agreement ${number(curve.coherence[line], 3)}` : "";
        const residual = curve.residual ? `, residual ${number(curve.residual[line], 3)} times the noise` : "";
        return `${curve.label} ${number(curve.amplitude[line], 4)}${angle}${agreement}${residual}`;
      });
      this.readout.textContent = `${number(this.frequency[line], 6)} Hz: ${words.join("; ")}`;
    }

    drawBands(plot) {
      const { left, top, width, height } = plot.bbox;
      plot.ctx.save();
      plot.ctx.fillStyle = colour("--band");
      for (const [low, high] of this.bands) {
        const from = Math.max(plot.valToPos(low, "x", true), left);
        const to = Math.min(plot.valToPos(high, "x", true), left + width);
        if (to > from) plot.ctx.fillRect(from, top, Math.max(to - from, 1), height);
      }
      plot.ctx.restore();
    }

    /* A dashed line where the residual is as large as the noise. */
    drawNoise(plot) {
      const { left, width } = plot.bbox;
      const dots = window.devicePixelRatio || 1;
      const y = plot.valToPos(1, "y", true);
      plot.ctx.save();
      plot.ctx.strokeStyle = colour("--agreement");
      plot.ctx.lineWidth = 2 * dots;
      plot.ctx.setLineDash([6 * dots, 4 * dots]);
      plot.ctx.beginPath();
      plot.ctx.moveTo(left, y);
      plot.ctx.lineTo(left + width, y);
      plot.ctx.stroke();
      plot.ctx.restore();
    }

    drawNatural(plot, named) {
      const { left, top, width, height } = plot.bbox;
      const { ctx } = plot;
      const dots = window.devicePixelRatio || 1;
      let free = -Infinity;
      ctx.save();
      ctx.strokeStyle = ctx.fillStyle = colour("--muted");
      ctx.lineWidth = dots;
      ctx.setLineDash([2 * dots, 3 * dots]);
      ctx.font = `${11 * dots}px system-ui, sans-serif`;
      ctx.textAlign = "center";
      for (const frequency of this.natural) {
        const x = plot.valToPos(frequency, "x", true);
        if (!(x >= left && x <= left + width)) continue;
        ctx.beginPath();
        ctx.moveTo(x, top);
        ctx.lineTo(x, top + height);
        ctx.stroke();
        const place = Math.min(Math.max(x, left + 24 * dots), left + width - 24 * dots);
        if (!named || place - free < 58 * dots) continue;
        ctx.fillText(`${number(frequency, 4)} Hz`, place, top - 6 * dots);
        free = place;
      }
      ctx.restore();
    }

    /* Some lines of what is in view, every peak among them. */
    tableLines() {
      const first = this.nearest(this.range[0]), last = this.nearest(this.range[1]);
      const chosen = new Set([first, last]);
      const step = Math.max(1, Math.ceil((last - first) / TABLE_ROWS));
      const values = this.curves[0].amplitude;
      for (let start = first; start <= last; start += step) {
        let highest = start;
        for (let line = start; line < Math.min(start + step, last + 1); line++) if ((values[line] ?? 0) > (values[highest] ?? 0)) highest = line;
        chosen.add(highest);
      }
      return [...chosen].sort((one, other) => one - other);
    }

    fillTable() {
      if (!this.details.open) return;
      const heads = ["Frequency [Hz]"];
      for (const curve of this.curves) heads.push(`${curve.label} [${this.data.unit}]`, ...(curve.phase ? [`${curve.label}, phase [\u00b0]`] : []), ...(curve.coherence ? [`${curve.label}, agreement [-]`] : []), ...(curve.residual ? ["residual / noise"] : []));
      const rows = this.tableLines().map((line) => {
        const cells = [number(this.frequency[line], 6)];
        for (const curve of this.curves) cells.push(number(curve.amplitude[line], 4), ...(curve.phase ? [number(curve.phase[line], 4)] : []), ...(curve.coherence ? [number(curve.coherence[line], 3)] : []), ...(curve.residual ? [number(curve.residual[line], 3)] : []));
        return element("tr", {}, ...cells.map((text) => element("td", { class: "number" }, text)));
      });
      const head = element("tr", {}, ...heads.map((text) => element("th", { scope: "col", class: "number" }, text)));
      this.table.replaceChildren(element("table", {}, element("thead", {}, head), element("tbody", {}, ...rows)));
    }
  }

  /* How parts in space are seen; all drawings of a host turn together, by a hand or by arrow keys. */
  function spaceView(host, modes, width, height, edge) {
    const points = modes.flatMap((mode) => mode.parts.flatMap((part) => part.points));
    const ends = [0, 1, 2].map((axis) => [Math.min(...points.map((point) => point[axis])), Math.max(...points.map((point) => point[axis]))]);
    const middle = ends.map(([low, high]) => (low + high) / 2);
    const size = Math.hypot(...ends.map(([low, high]) => high - low)) || 1;
    const scale = 1.2 * (height - 2 * edge) / size;
    const view = (host.view = host.view ?? { azimuth: -0.96, elevation: 0.44 });
    const project = (point) => {
      const [x, y, z] = point.map((value, axis) => value - middle[axis]);
      const [sine, cosine] = [Math.sin(view.azimuth), Math.cos(view.azimuth)];
      const ahead = cosine * x + sine * y;
      return [width / 2 + scale * (cosine * y - sine * x), height / 2 - scale * (Math.cos(view.elevation) * z - Math.sin(view.elevation) * ahead)];
    };
    const turn = (sideways, upwards) => {
      view.azimuth -= sideways;
      view.elevation = Math.max(-1.57, Math.min(1.57, view.elevation + upwards));
      host.dispatchEvent(new Event("turned"));
    };
    const makeTurnable = (drawing) => {
      drawing.setAttribute("tabindex", "0");
      drawing.classList.add("turns");
      drawing.addEventListener("pointerdown", (event) => drawing.setPointerCapture(event.pointerId));
      drawing.addEventListener("pointermove", (event) => { if (drawing.hasPointerCapture(event.pointerId)) turn(event.movementX / 90, event.movementY / 90); });
      drawing.addEventListener("keydown", (event) => {
        const step = { ArrowLeft: [-0.15, 0], ArrowRight: [0.15, 0], ArrowUp: [0, -0.15], ArrowDown: [0, 0.15] }[event.key];
        if (step) { event.preventDefault(); turn(...step); }
      });
    };
    return { makeTurnable, project, reach: 0.12 * size };
  }

  /* Mode shapes as lines that swing, unless somebody prefers them to stand still; the button holds them. */
  function drawModes(host, modes) {
    const inSpace = modes.some((mode) => mode.parts.some((part) => part.points));
    const [width, height, edge] = [280, inSpace ? 190 : 110, 12];
    const view = inSpace ? spaceView(host, modes, width, height, edge) : null;
    const along = inSpace ? [0] : modes.flatMap((mode) => mode.parts.flatMap((part) => part.along));
    const [first, last] = [Math.min(...along), Math.max(...along)];
    const x = (place) => (last > first ? edge + ((width - 2 * edge) * (place - first)) / (last - first) : width / 2);
    const y = (motion) => height / 2 - (height / 2 - edge) * motion;
    const svg = (name, attributes, ...children) => {
      const made = document.createElementNS("http://www.w3.org/2000/svg", name);
      Object.entries(attributes).forEach(([key, value]) => made.setAttribute(key, value));
      made.append(...children);
      return made;
    };
    const moving = [];
    const figures = modes.map((mode) => {
      const lines = mode.parts.map((part, number) => {
        if (view) {
          const line = svg("path", { class: `shape shape-${number % 4}` });
          moving.push((swing) => {
            const at = part.points.map((point, node) => view.project(point.map((value, axis) => value + swing * view.reach * part.motion[node][axis])));
            const text = ([x, y]) => `${x.toFixed(1)} ${y.toFixed(1)}`;
            const dots = at.map((place) => `M${text(place)}h0`).join("");
            line.setAttribute("d", dots + part.lines.map(([one, other]) => `M${text(at[one])}L${text(at[other])}`).join(""));
          });
          return line;
        }
        const line = svg("polyline", { class: `shape shape-${number % 4}` });
        moving.push((swing) => line.setAttribute("points", (part.along.length > 1 ? part.along : [part.along[0], part.along[0]]).map((place, node) => `${x(place).toFixed(1)},${y(swing * part.across[node % part.across.length]).toFixed(1)}`).join(" ")));
        return line;
      });
      const words = `Mode at ${number(mode.frequency, 5)} Hz: ${mode.parts.map((part) => part.name).join(", ")}`;
      const axis = view ? [] : [svg("line", { class: "axis", x1: edge, x2: width - edge, y1: height / 2, y2: height / 2 })];
      const drawing = svg("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": words }, ...axis, ...lines);
      if (view) view.makeTurnable(drawing);
      return element("figure", { class: "mode" }, drawing, element("figcaption", {}, `${number(mode.frequency, 5)} Hz`));
    });
    const names = modes.length ? modes[0].parts.map((part, number) => element("span", { class: `key shape-key-${number % 4}` }, part.name)) : [];
    const still = window.matchMedia("(prefers-reduced-motion: reduce)").matches;
    const move = (swing) => moving.forEach((set) => set(swing));
    host.moving = host.moving ?? !still;
    const hold = element("button", { type: "button", "aria-pressed": String(!host.moving) }, "hold still");
    hold.addEventListener("click", () => { host.moving = !host.moving; hold.setAttribute("aria-pressed", String(!host.moving)); if (host.moving) swing(); else move(1); });
    const began = (host.drawing = performance.now());
    function swing() {
      if (host.drawing !== began || !host.moving || !host.isConnected) return;
      move(Math.sin((performance.now() - began) / 300));
      requestAnimationFrame(swing);
    }
    host.replaceChildren(element("div", { class: "chart-head" }, element("div", { class: "chart-legend" }, ...names), element("div", { class: "chart-buttons" }, hold)), element("div", { class: "modes" }, ...figures));
    host.drawTurned = () => { if (!host.moving) move(1); };
    if (!host.turns) host.addEventListener("turned", () => host.drawTurned());
    host.turns = true;
    move(1);
    swing();
  }

  function redraw() {
    charts.forEach((chart) => chart.plots.forEach((plot) => plot.redraw(false, true)));
  }

  /* Paper is light and has a width of its own. */
  function printing(begins) {
    document.documentElement.classList.toggle("printing", begins);
    charts.forEach((chart) => { chart.host.style.width = begins ? "660px" : ""; chart.fit(); });
    redraw();
  }

  /* Draw the charts whose data stand in the page, each in the element that names them. */
  function drawAll() {
    for (const host of document.querySelectorAll("[data-chart]")) {
      const chart = new FrfChart(host, JSON.parse(document.getElementById(host.dataset.chart).textContent));
      chart.fit();
    }
    for (const host of document.querySelectorAll("[data-modes]")) drawModes(host, JSON.parse(document.getElementById(host.dataset.modes).textContent));
  }

  dark.addEventListener("change", redraw);
  window.addEventListener("beforeprint", () => printing(true));
  window.addEventListener("afterprint", () => printing(false));
  return { FrfChart, charts, colour, drawAll, drawModes, decode, element, number };
})();
