// Shared by the pages: elements, pictures as SVG, round numbers for an axis, numbers as text.
const drawing = (() => {
  'use strict';
  const get = id => document.getElementById(id);
  const make = (parent, tag, text, name) => {
    const element = parent.appendChild(document.createElement(tag));
    if (text !== undefined) element.textContent = text;
    if (name) element.className = name;
    return element;
  };
  const svg = (parent, width, height, more = {}) =>
      draw(parent, 'svg', {viewBox: `0 0 ${width} ${height}`, height: height, ...more});
  const draw = (parent, tag, attributes, text) => {
    const element = parent.appendChild(document.createElementNS('http://www.w3.org/2000/svg', tag));
    for (const key in attributes) element.setAttribute(key, attributes[key]);
    if (text !== undefined) element.textContent = text;
    return element;
  };
  const signs = text => text.replace(/\+-/g, '\u00b1').replace(/([0-9] )(m?)Ohm/g, '$1$2\u03a9');
  /// Round numbers from low to high, about `count` of them.
  const ticks = (low, high, count) => {
    const rough = (high - low) / count, power = Math.pow(10, Math.floor(Math.log10(rough)));
    const step = [1, 2, 5, 10].map(m => m * power).find(s => s >= rough);
    const all = [];
    for (let t = Math.ceil(low / step - 1e-9) * step; t <= high + 1e-9 * step; t += step)
      all.push(Math.abs(t) < 1e-12 ? 0 : +t.toPrecision(10));
    return all;
  };
  const hint = (element, text) => draw(element, 'title', {}, text);
  const percent = f => (100 * f).toFixed(0) + ' %';
  /// Millivolts with about three digits.
  const mv = v => {
    if (v < 1) return v.toFixed(2) + ' mV';
    return v.toFixed(v < 100 ? 1 : 0) + ' mV';
  };
  /// Hours as h:mm, or as h:mm:ss if there are seconds or they are asked for.
  const clock = (h, seconds) => {
    const s = Math.round(h * 3600), two = n => String(n).padStart(2, '0');
    const more = s % 60 || seconds === true ? ':' + two(s % 60) : '';
    return Math.floor(s / 3600) + ':' + two(Math.floor(s / 60) % 60) + more;
  };
  /// Step of a time axis in s, for `room` labels: of whole seconds, minutes, hours or days.
  const time_step = (range_s, room) => {
    const steps = [1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 10800, 21600, 43200, 86400];
    return steps.find(s => range_s / s <= room) || 86400 * Math.ceil(range_s / room / 86400);
  };
  /// Ticks of a time axis in hours at round times, all labels in one format. A `ticker` of Dygraph.
  const time_ticks = (from, to, pixels) => {
    const step = time_step(3600 * (to - from), Math.max(2, Math.floor(pixels / 70))), all = [];
    for (let k = Math.ceil(3600 * from / step - 1e-6); k * step <= 3600 * to + 1e-6; ++k)
      all.push({v: k * step / 3600, label: clock(k * step / 3600, step < 60)});
    return all;
  };
  /// The x axis of a chart over hours: options of Dygraph.
  const time_axis = {ticker: time_ticks, valueFormatter: h => clock(h)};
  /// Its title. from, to: hours.
  const time_title = (from, to) => time_step(3600 * (to - from), 8) < 60 ? 'time, h:mm:ss' : 'time, h:mm';
  const colour = name => getComputedStyle(document.documentElement).getPropertyValue('--' + name).trim();
  /// Lists the warnings in an element. Those that differ only in their numbers are shown once.
  const warnings = (element, texts) => {
    const groups = new Map();
    for (const text of texts) {
      const kind = text.replace(/[0-9.]+/g, '#');
      groups.set(kind, [...(groups.get(kind) || []), text]);
    }
    if (groups.size === 0) return element.remove();
    const list = make(element.parentElement, 'ul', undefined, 'warnings');
    list.id = element.id;
    element.replaceWith(list);
    for (const [first, ...more] of groups.values()) {
      const item = make(list, 'li', first);
      if (more.length === 0) continue;
      const rest = make(item, 'details');
      make(rest, 'summary', `and ${more.length} more of this kind`);
      for (const text of more) make(rest, 'div', text);
    }
  };
  /// The colour of a line by what it shows: the same on every page.
  const meaning = [
    [/^(measured|present)/, 'measured'], [/open loop/, 'open-loop'], [/reference|^true/, 'reference'],
    [/simulated|estimate|predicted|^new|model/, 'model']
  ];
  const colours_of = labels => {
    const free = ['model', 'reference', 'current', 'other', 'open-loop', 'measured'];
    const named = labels.map(label => (meaning.find(([pattern]) => pattern.test(label)) || [])[1]);
    const rest = free.filter(name => !named.includes(name));
    return labels.map((_, k) => colour(named[k] || rest.shift() || 'hint'));
  };
  /// A chart over the time in hours, or over `x` if it is given. more: options of Dygraph.
  const chart = (div, labels, rows, legend, more = {}) => {
    const last = rows.length - 1;
    return new Dygraph(div, rows, {
      labels: [more.x || 'time', ...labels],
      xlabel: more.x || (rows.length ? time_title(rows[0][0], rows[last][0]) : 'time, h:mm'),
      xLabelHeight: 15,
      labelsDiv: legend,
      legend: 'always',
      colors: colours_of(labels),
      axisLabelFontSize: 12,
      gridLineColor: colour('grid'),
      axisLineColor: colour('grid'),
      strokeWidth: 1.3,
      fillAlpha: 0.22,
      ...more,
      axes: {x: more.x ? {} : time_axis, y: {axisLabelWidth: 58, pixelsPerLabel: 24}, ...more.axes},
    });
  };
  /// Charts of a printed page are as wide as the paper.
  addEventListener('beforeprint', () => {
    for (const c of window.charts || []) c.resize(Math.min(680, c.width_), c.height_);
  });
  addEventListener('afterprint', () => {
    for (const c of window.charts || []) c.resize();
  });
  return {
    get,
    make,
    draw,
    svg,
    hint,
    signs,
    ticks,
    percent,
    mv,
    clock,
    time_axis,
    time_title,
    colour,
    warnings,
    chart,
    red: colour('reference'),
    blue: colour('model'),
    green: colour('current'),
    dark: colour('measured'),
    grey: colour('hint'),
    faint: colour('grid')
  };
})();
