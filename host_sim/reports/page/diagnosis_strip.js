// The strip of a diagnosis: errors of both models over time, with state of charge, current and temperature.
const strip = (() => {
  'use strict';
  const {draw, svg, ticks, clock, mv, green, dark, faint} = drawing;
  const palette = [[247, 249, 250], [255, 214, 110], [228, 87, 46], [122, 20, 60]];
  const amber = drawing.colour('amber'), left = 118, right = 8, gap = 7, top = 14;

  /// Colour of an error, 0..1.
  const shade = t => {
    const x = Math.min(0.9999, Math.max(0, t)) * 3, k = Math.floor(x);
    return 'rgb(' + palette[k].map((c, i) => Math.round(c + (x - k) * (palette[k + 1][i] - c))).join() + ')';
  };
  const quantile = (values, q) => {
    const sorted = values.filter(Number.isFinite).sort((a, b) => a - b);
    return sorted.length ? sorted[Math.floor(q * (sorted.length - 1))] : 0;
  };
  /// All finite values of a column, over all recordings.
  const all = key => report.strips.flatMap(s => s[key]).filter(Number.isFinite);

  const lanes_of_report = () => {
    const lanes = [{title: 'cell file', key: 'before_mv', height: 34, kind: 'heat'}];
    if (report.named) lanes.push({title: 'extended cell', key: 'after_mv', height: 34, kind: 'heat'});
    lanes.push({title: 'state of charge', key: 'soc', height: 44, kind: 'line', unit: '%', colour: dark});
    lanes.push({title: 'current', low: 'low_a', high: 'high_a', height: 44, kind: 'band', unit: 'A', colour: green});
    if (all('temperature_c').length) {
      const temperature = {title: 'temperature', key: 'temperature_c', height: 38, kind: 'line'};
      lanes.push(Object.assign(temperature, {unit: '\u00b0C', colour: amber}));
    }
    return lanes;
  };

  /// Places of one recording in the picture: its column from x0, `wide` pixels.
  const places = (r, x0, wide) => {
    const duration_s = (r.to_s - r.from_s) || 1, bins = r.before_mv.length;
    return {x0, wide, bins, duration_s, x: k => x0 + wide * k / bins, at: t => x0 + wide * (t - r.from_s) / duration_s};
  };

  const heat_lane = (s, r, p, lane, y, most) => {
    r[lane.key].forEach((v, k) => {
      if (v === null) return;
      draw(s, 'rect', {x: p.x(k), y: y, width: p.wide / p.bins + 0.4, height: lane.height, fill: shade(v / most)});
    });
  };

  const value_lane = (s, r, p, lane, y, labelled) => {
    const values = lane.kind === 'line' ? all(lane.key) : all(lane.low).concat(all(lane.high), [0]);
    let low = Math.min(...values), high = Math.max(...values);
    if (high - low < 1e-9) {
      low -= 1;
      high += 1;
    }
    const place = v => y + lane.height - 3 - (v - low) / (high - low) * (lane.height - 6);
    const points = key => r[key].map((v, k) => v === null ? null : [p.x(k + 0.5), place(v)]).filter(q => q);
    const style = {fill: lane.colour, 'fill-opacity': 0.35, stroke: lane.colour, 'stroke-width': 0.8};
    if (lane.kind === 'line') {
      const line = {fill: 'none', stroke: lane.colour, 'stroke-width': 1.4};
      draw(s, 'polyline', Object.assign({points: points(lane.key).join(' ')}, line));
    } else {
      draw(s, 'line', {x1: p.x0, x2: p.x0 + p.wide, y1: place(0), y2: place(0), stroke: faint});
      const outline = points(lane.high).concat(points(lane.low).reverse());
      draw(s, 'polygon', Object.assign({points: outline.join(' ')}, style));
    }
    if (!labelled) return;
    const digits = high - low < 10 ? 1 : 0;
    draw(s, 'text', {x: left - 6, y: y + 11, class: 'end'}, high.toFixed(digits) + ' ' + lane.unit);
    draw(s, 'text', {x: left - 6, y: y + lane.height - 2, class: 'end'}, low.toFixed(digits));
  };

  /// Marks the spans in which the diagnosis found the mismatch.
  const mark_spans = (s, r, p, bottom) => {
    for (const [from, to] of r.spans || []) {
      const width = p.at(to) - p.at(from);
      draw(s, 'rect', {x: p.at(from), y: 3, width: Math.max(3, width), height: 6, fill: dark, rx: 2});
      if ((to - from) / p.duration_s >= 0.9) continue;
      const frame = {fill: 'none', stroke: dark, 'stroke-opacity': 0.45, 'stroke-dasharray': '3 3'};
      const area = {x: p.at(from), y: top, width: Math.max(1, width), height: bottom - top};
      draw(s, 'rect', Object.assign(area, frame));
    }
  };

  const time_axis = (s, r, p, y) => {
    const units = [['h', 3600, 2], ['min', 60, 1 / 30], ['s', 1, 0]], hours = (r.to_s - r.from_s) / 3600;
    const [name, seconds] = units.find(u => hours >= u[2]);
    ticks(0, (r.to_s - r.from_s) / seconds || 1, Math.max(1, p.wide / 90)).forEach((t, k) => {
      const x = p.x0 + p.wide * t * seconds / p.duration_s;
      draw(s, 'text', {x: x, y: y, class: k === 0 ? '' : 'middle'}, t + (k === 0 ? ' ' + name : ''));
    });
  };

  /// The values under the mouse as text.
  const values_at = (r, k, bins) => {
    const part = (v, text) => v === null ? '' : ' \u00b7 ' + text(v);
    return r.name + ' at ' + clock((r.to_s - r.from_s) * (k + 0.5) / bins / 3600) + ' h' + part(r.before_mv[k], mv) +
        (report.named ? part(r.after_mv[k], v => mv(v) + ' with the findings') : '') +
        part(r.soc[k], v => v.toFixed(1) + ' %') + part(r.high_a[k], v => v.toFixed(2) + ' A') +
        part(r.temperature_c[k], v => v.toFixed(1) + ' \u00b0C');
  };

  const follow_mouse = (s, r, p, bottom, note, most) => {
    const cursor = draw(s, 'line', {y1: top, y2: bottom, stroke: dark, 'stroke-width': 0.8, visibility: 'hidden'});
    const shield = draw(s, 'rect', {x: p.x0, y: 0, width: p.wide, height: bottom + gap, fill: 'transparent'});
    shield.addEventListener('mousemove', e => {
      const part = (e.clientX - shield.getBoundingClientRect().left) / p.wide;
      const k = Math.min(p.bins - 1, Math.max(0, Math.floor(part * p.bins)));
      for (const end of ['x1', 'x2']) cursor.setAttribute(end, p.x(k + 0.5));
      cursor.setAttribute('visibility', 'visible');
      note.textContent = values_at(r, k, p.bins);
    });
    shield.addEventListener('mouseleave', () => {
      cursor.setAttribute('visibility', 'hidden');
      show_scale(note, most);
    });
  };

  const show_scale = (note, most) => {
    note.textContent = 'measured minus simulated voltage: 0 ';
    const style = 'display:inline-block;width:120px;vertical-align:-1px';
    const bar = draw(note, 'svg', {width: 120, height: 10, style: style});
    for (let k = 0; k < 40; ++k) draw(bar, 'rect', {x: 3 * k, y: 0, width: 3.3, height: 10, fill: shade(k / 39)});
    note.appendChild(document.createTextNode(' ' + mv(most) + ' and more'));
  };

  /// note: element for the scale, or for the values under the mouse.
  const draw_strip = (box, note) => {
    box.textContent = '';
    const most = Math.max(quantile(all('before_mv'), 0.98), 2 * report.floor_mv, 1), lanes = lanes_of_report();
    const width = Math.max(300, box.clientWidth), bottom = top + lanes.reduce((sum, l) => sum + l.height + gap, 0);
    const s = svg(box, width, bottom + 16);
    const total = report.strips.reduce((sum, r) => sum + (r.to_s - r.from_s), 0) || 1;
    const between = report.strips.length > 1 ? 6 : 0;
    const free = width - left - right - between * (report.strips.length - 1);
    let x0 = left;
    report.strips.forEach((r, n) => {
      const p = places(r, x0, free * (r.to_s - r.from_s) / total);
      let y = top;
      for (const lane of lanes) {
        const style = lane.kind === 'heat' ? 'strong' : '';
        if (n === 0) draw(s, 'text', {x: 0, y: y + lane.height / 2 + 4, class: style}, lane.title);
        draw(s, 'rect', {x: x0, y: y, width: p.wide, height: lane.height, fill: drawing.colour('card'), stroke: faint});
        if (lane.kind === 'heat')
          heat_lane(s, r, p, lane, y, most);
        else
          value_lane(s, r, p, lane, y, n === 0);
        y += lane.height + gap;
      }
      mark_spans(s, r, p, y - gap);
      if (n === 0 && (r.spans || []).length) draw(s, 'text', {x: 0, y: 10}, 'found here');
      time_axis(s, r, p, y + 8);
      follow_mouse(s, r, p, y - gap, note, most);
      x0 += p.wide + between;
    });
    show_scale(note, most);
  };
  return draw_strip;
})();
