// Draws the page from `report` (reports/diagnosis_page.cpp). Pictures of its own as SVG, curves over time by dygraphs.
(() => {
  'use strict';
  const {get, make, draw, svg, signs, ticks, red, blue, green, dark, faint} = drawing;
  const hint = (element, text) => draw(element, 'title', {}, text);
  const sand = '#f6e3b4';
  const verdicts = {NO_MISMATCH: green, CAUSE: blue, CAUSES: blue, AMBIGUOUS: '#a86a00', UNKNOWN: '#7a4fb0', DATA_FAULT: '#b3261e', NOT_TESTABLE: '#66707c'};
  const sentence = text => text.charAt(0).toUpperCase() + text.slice(1);
  const bare = name => sentence(name.replace(/^(an?) /, ''));
  const mv = v => (v < 1 ? v.toFixed(2) : v < 100 ? v.toFixed(1) : v.toFixed(0)) + ' mV';
  const percent = f => (100 * f).toFixed(0) + ' %';
  const clock = h => {
    const s = Math.round(h * 3600), two = n => String(n).padStart(2, '0');
    return Math.floor(s / 3600) + ':' + two(Math.floor(s / 60) % 60) + (s % 60 ? ':' + two(s % 60) : '');
  };
  const quantile = (values, q) => {
    const sorted = values.filter(Number.isFinite).sort((a, b) => a - b);
    return sorted.length ? sorted[Math.floor(q * (sorted.length - 1))] : 0;
  };
  const fitted = (text, pixels) => text.length * 6.1 > pixels ? text.slice(0, Math.max(3, Math.floor(pixels / 6.1) - 1)) + '\u2026' : text;

  // --- head
  get('verdict').textContent = report.verdict.replace('_', ' ');
  get('verdict').style.background = verdicts[report.verdict];
  get('statement').textContent = signs(report.statement);
  get('subtitle').textContent = report.subtitle;
  get('warnings').textContent = report.warnings.join(' \u00b7 ');

  // --- where: how far off over time, and what was going on
  const palette = [[247, 249, 250], [255, 214, 110], [228, 87, 46], [122, 20, 60]];
  const shade = t => {
    const x = Math.min(0.9999, Math.max(0, t)) * 3, k = Math.floor(x);
    return 'rgb(' + palette[k].map((c, i) => Math.round(c + (x - k) * (palette[k + 1][i] - c))).join() + ')';
  };
  const drawStrip = () => {
    const box = get('strip');
    box.textContent = '';
    const all = key => report.strips.flatMap(s => s[key]).filter(Number.isFinite);
    const most = Math.max(quantile(all('before_mv'), 0.98), 2 * report.floor_mv, 1);
    const lanes = [{title: 'cell file', key: 'before_mv', height: 34, kind: 'heat'}];
    if (report.named) lanes.push({title: 'extended cell', key: 'after_mv', height: 34, kind: 'heat'});
    lanes.push({title: 'state of charge', key: 'soc', height: 44, kind: 'line', unit: '%', colour: dark});
    lanes.push({title: 'current', low: 'low_a', high: 'high_a', height: 44, kind: 'band', unit: 'A', colour: green});
    if (all('temperature_c').length) lanes.push({title: 'temperature', key: 'temperature_c', height: 38, kind: 'line', unit: '\u00b0C', colour: '#a86a00'});
    const left = 118, right = 8, gap = 7, top = 14;
    const width = Math.max(300, box.clientWidth), height = top + lanes.reduce((sum, l) => sum + l.height + gap, 0) + 16;
    const s = svg(box, width, height);
    const total = report.strips.reduce((sum, r) => sum + (r.to_s - r.from_s), 0) || 1, between = report.strips.length > 1 ? 6 : 0;
    const free = width - left - right - between * (report.strips.length - 1);
    let x0 = left;
    report.strips.forEach((r, n) => {
      const wide = free * (r.to_s - r.from_s) / total, bins = r.before_mv.length, x = k => x0 + wide * k / bins, at = t => x0 + wide * (t - r.from_s) / ((r.to_s - r.from_s) || 1);
      let y = top;
      lanes.forEach(lane => {
        if (n === 0) draw(s, 'text', {x: 0, y: y + lane.height / 2 + 4, class: lane.kind === 'heat' ? 'strong' : ''}, lane.title);
        draw(s, 'rect', {x: x0, y: y, width: wide, height: lane.height, fill: '#fff', stroke: faint});
        if (lane.kind === 'heat') {
          r[lane.key].forEach((v, k) => {
            if (v !== null) draw(s, 'rect', {x: x(k), y: y, width: wide / bins + 0.4, height: lane.height, fill: shade(v / most)});
          });
        } else {
          const values = lane.kind === 'line' ? all(lane.key) : all(lane.low).concat(all(lane.high), [0]);
          let low = Math.min(...values), high = Math.max(...values);
          if (high - low < 1e-9) low -= 1, high += 1;
          const yy = v => y + lane.height - 3 - (v - low) / (high - low) * (lane.height - 6);
          const points = key => r[key].map((v, k) => v === null ? null : [x(k + 0.5), yy(v)]).filter(p => p);
          if (lane.kind === 'line') {
            draw(s, 'polyline', {points: points(lane.key).join(' '), fill: 'none', stroke: lane.colour, 'stroke-width': 1.4});
          } else {
            draw(s, 'line', {x1: x0, x2: x0 + wide, y1: yy(0), y2: yy(0), stroke: faint});
            draw(s, 'polygon', {points: points(lane.high).concat(points(lane.low).reverse()).join(' '), fill: lane.colour, 'fill-opacity': 0.35, stroke: lane.colour, 'stroke-width': 0.8});
          }
          if (n === 0) {
            const digits = high - low < 10 ? 1 : 0;
            draw(s, 'text', {x: left - 6, y: y + 11, class: 'end'}, high.toFixed(digits) + ' ' + lane.unit);
            draw(s, 'text', {x: left - 6, y: y + lane.height - 2, class: 'end'}, low.toFixed(digits));
          }
        }
        y += lane.height + gap;
      });
      for (const [from, to] of r.spans || []) {
        draw(s, 'rect', {x: at(from), y: 3, width: Math.max(3, at(to) - at(from)), height: 6, fill: dark, rx: 2});
        if ((to - from) / ((r.to_s - r.from_s) || 1) < 0.9) draw(s, 'rect', {x: at(from), y: top, width: Math.max(1, at(to) - at(from)), height: y - gap - top, fill: 'none', stroke: dark, 'stroke-opacity': 0.45, 'stroke-dasharray': '3 3'});
      }
      if (n === 0 && (r.spans || []).length) draw(s, 'text', {x: 0, y: 10}, 'found here');
      const hours = (r.to_s - r.from_s) / 3600, unit = hours >= 2 ? ['h', 3600] : hours >= 1 / 30 ? ['min', 60] : ['s', 1];
      const times = ticks(0, (r.to_s - r.from_s) / unit[1] || 1, Math.max(1, wide / 90));
      times.forEach((t, k) => draw(s, 'text', {x: x0 + wide * t * unit[1] / ((r.to_s - r.from_s) || 1), y: y + 8, class: k === 0 ? '' : 'middle'}, t + (k === 0 ? ' ' + unit[0] : '')));
      const cursor = draw(s, 'line', {y1: top, y2: y - gap, stroke: dark, 'stroke-width': 0.8, visibility: 'hidden'});
      const shield = draw(s, 'rect', {x: x0, y: 0, width: wide, height: y, fill: 'transparent'});
      shield.addEventListener('mousemove', e => {
        const k = Math.min(bins - 1, Math.max(0, Math.floor((e.clientX - shield.getBoundingClientRect().left) / wide * bins)));
        cursor.setAttribute('x1', x(k + 0.5));
        cursor.setAttribute('x2', x(k + 0.5));
        cursor.setAttribute('visibility', 'visible');
        const part = (v, text) => v === null ? '' : ' \u00b7 ' + text(v);
        note(r.name + ' at ' + clock((r.to_s - r.from_s) * (k + 0.5) / bins / 3600) + ' h' + part(r.before_mv[k], mv) + (report.named ? part(r.after_mv[k], v => mv(v) + ' with what was found') : '') +
             part(r.soc[k], v => v.toFixed(1) + ' %') + part(r.high_a[k], v => v.toFixed(2) + ' A') + part(r.temperature_c[k], v => v.toFixed(1) + ' \u00b0C'));
      });
      shield.addEventListener('mouseleave', () => { cursor.setAttribute('visibility', 'hidden'); scale(); });
      x0 += wide + between;
    });
    const note = text => { get('strip-note').textContent = text; };
    const scale = () => {
      const span = get('strip-note');
      span.textContent = 'measured less simulated voltage: 0 ';
      const bar = draw(span, 'svg', {width: 120, height: 10, style: 'display:inline-block;width:120px;vertical-align:-1px'});
      for (let k = 0; k < 40; ++k) draw(bar, 'rect', {x: 3 * k, y: 0, width: 3.3, height: 10, fill: shade(k / 39)});
      span.appendChild(document.createTextNode(' ' + mv(most) + ' and more'));
    };
    scale();
  };

  // --- how much
  const bars = (box, rows, options) => {
    // rows: {name, value, text, colour, low, high}
    const width = Math.max(240, box.clientWidth), each = options.each || 20, left = options.left, right = options.right, room = width - left - right;
    const s = svg(box, width, rows.length * each + (options.foot || 0));
    const x = v => left + room * Math.max(0, Math.min(1, v));
    rows.forEach((r, k) => {
      const y = k * each;
      hint(draw(s, 'text', {x: 0, y: y + each / 2 + 4, class: r.strong ? 'strong' : ''}, fitted(r.name, left - 6)), r.name + (r.hint ? ': ' + r.hint : ''));
      draw(s, 'rect', {x: left, y: y + each / 2 - 5, width: room, height: 10, fill: '#f1f4f7'});
      if (r.value !== null) draw(s, 'rect', {x: Math.min(x(r.zero || 0), x(r.value)), y: y + each / 2 - 5, width: Math.max(1.5, Math.abs(x(r.value) - x(r.zero || 0))), height: 10, fill: r.colour || blue});
      if (r.low !== undefined) {
        draw(s, 'line', {x1: x(r.low), x2: x(r.high), y1: y + each / 2, y2: y + each / 2, stroke: dark, 'stroke-width': 1.6});
        for (const end of [r.low, r.high]) draw(s, 'line', {x1: x(end), x2: x(end), y1: y + each / 2 - 4, y2: y + each / 2 + 4, stroke: dark, 'stroke-width': 1.6});
      }
      draw(s, 'text', {x: width, y: y + each / 2 + 4, class: 'end'}, r.text);
    });
    return {s, x, width, height: rows.length * each};
  };
  const limitRows = list => list.map(l => ({name: bare(l.name), text: signs(l.text), value: 1 + Math.log10(Math.max(l.ratio, 1e-4)) / 4, colour: '#7fa8cf', hint: l.id}));
  const drawMuch = () => {
    const box = get('much');
    box.textContent = '';
    if (report.mechanisms.length) {
      const most = Math.max(report.error_mv || 0, ...report.mechanisms.map(m => m.rms_mv));
      for (const m of report.mechanisms) {
        make(box, 'p', [m.name, ...m.rivals].map((n, k) => k ? n : bare(n)).join(', or '), 'subject');
        const rows = [{name: 'of the error', text: mv(m.rms_mv), value: m.rms_mv / most, colour: '#e39a3b', hint: 'RMS on these recordings; the whole bar is the error of ' + mv(report.error_mv)}];
        for (const p of m.parameters) {
          if (p.given && m.parameters.length > 2 || report.mechanisms.length > 2 && !p.strength) continue;
          const log = p.shape && p.low > 0, place = v => log ? Math.log(v / p.low) / Math.log(p.high / p.low) : (v - p.low) / (p.high - p.low);
          const row = {name: p.name.replace(/_(v_per_k|j_per_mol|k_per_w|v|ohm|a|s|k|c)$/, '').replace(/_/g, ' '), text: signs(p.text) + (p.at_bound ? ' (bound)' : ''), value: p.given ? null : place(p.value), zero: !log && p.low < 0 ? place(0) : 0, hint: p.meaning, colour: '#7fa8cf'};
          if (p.deviation > 0 && !p.given) row.low = place(Math.max(p.low, p.value - 2 * p.deviation)), row.high = place(Math.min(p.high, p.value + 2 * p.deviation));
          rows.push(row);
        }
        bars(make(box, 'div'), rows, {left: 92, right: 122, each: report.mechanisms.length > 2 ? 18 : 21});
      }
      make(box, 'p', 'Orange: mV RMS of these recordings\u2019 ' + mv(report.error_mv) + '. Blue: within what is possible, with two standard deviations.', 'why');
    } else if (report.verdict === 'NO_MISMATCH') {
      get('much-title').textContent = 'What would have shown';
      bars(make(box, 'div'), limitRows(report.limits.slice(0, 9)), {left: 168, right: 74, each: 21});
    } else if (report.faults.length) {
      get('much-title').textContent = 'What is wrong with the data';
      for (const fault of report.faults) make(box, 'p', fault, 'action');
    } else if (report.verdict === 'UNKNOWN') {
      bars(make(box, 'div'), [{name: 'all of the error', text: mv(report.error_mv), value: 1, colour: '#e39a3b'}, {name: 'noise floor', text: mv(report.floor_mv), value: report.floor_mv / report.error_mv, colour: '#7fa8cf'}], {left: 130, right: 80});
      make(box, 'p', 'Nothing in the catalogue explains it, so nothing was added to the cell file.', 'why');
    } else {
      get('much-title').textContent = 'Why nothing can be said';
      make(box, 'p', signs(report.statement), 'action');
    }
  };

  // --- before and after
  if (!report.named) get('before-after').previousElementSibling.firstChild.textContent = 'Against the noise floor ';
  const drawBeforeAfter = () => {
    const box = get('before-after');
    box.textContent = '';
    if (!report.figures.length) return make(box, 'p', 'No voltage to compare with.', 'why');
    const width = Math.max(240, box.clientWidth), most = 1.08 * Math.max(report.floor_mv, ...report.figures.flatMap(f => [f.before_mv, f.after_mv])), room = width - 4, x = v => 2 + (room - 62) * v / most;
    const pairs = report.figures.map(f => ({title: f.name, before: f.before_mv, after: f.after_mv, at: x, text: mv}));
    if (report.soc) {
      const top = 1.08 * Math.max(report.soc.before, report.soc.after);
      pairs.splice(1, 0, {title: 'state of charge, estimated on it', before: report.soc.before, after: report.soc.after, at: v => 2 + (room - 62) * v / top, text: v => v.toFixed(2) + ' %', own: true});
    }
    const each = report.named ? 58 : 42, s = svg(box, width, pairs.length * each + 18);
    pairs.forEach((p, k) => {
      const y = k * each;
      draw(s, 'text', {x: 2, y: y + 12, class: 'strong'}, fitted(p.title, width - 20));
      [[p.before, report.named ? red : '#7a8794', 'cell file'], [p.after, blue, 'with what was found']].forEach(([v, colour, name], i) => {
        if (i === 1 && !report.named) return;
        hint(draw(s, 'rect', {x: 2, y: y + 17 + 17 * i, width: Math.max(1.5, p.at(v) - 2), height: 14, fill: colour}), name);
        const end = p.at(v) + 5, floor = x(report.floor_mv);  // the number keeps off the floor's line
        draw(s, 'text', {x: !p.own && floor > end - 4 && floor < end + 50 ? floor + 5 : end, y: y + 28 + 17 * i}, p.text(v));
      });
      if (!p.own && report.floor_mv > 0) draw(s, 'line', {x1: x(report.floor_mv), x2: x(report.floor_mv), y1: y + 14, y2: y + each - 7, stroke: dark, 'stroke-dasharray': '3 2'});
    });
    let y = pairs.length * each + 11, from = 2;
    const key = (colour, text) => {
      draw(s, 'rect', {x: from, y: y - 9, width: 10, height: 10, fill: colour});
      draw(s, 'text', {x: from + 14, y: y}, text);
      from += 26 + 6 * text.length;
    };
    key(report.named ? red : '#7a8794', 'cell file');
    if (report.named) key(blue, 'extended');
    if (report.floor_mv > 0) draw(s, 'text', {x: from, y: y}, '\u2506 noise floor ' + mv(report.floor_mv));
    if (!report.has_holdout && report.named) {
      const p = make(box, 'p', 'Nothing was held back. The proof is a later recording, given with ', 'why');
      make(p, 'code', '--holdout');
    }
  };

  // --- why this
  if (!report.named) get('why').previousElementSibling.firstChild.textContent = 'Why nothing is named ';
  const drawWhy = () => {
    const box = get('why');
    box.textContent = '';
    if (report.candidates.length) {
      const list = report.candidates.slice(0, 6), best = Math.max(1.25 * report.detected, list[0].gain);
      const b = bars(box, list.map((c, k) => ({name: c.name, text: (k > 0 && report.named ? '\u2212' + (list[0].gain - c.gain).toFixed(0) : c.gain.toFixed(0)) + ' \u00b7 ' + percent(c.share), value: Math.max(0, c.gain) / best, colour: report.named && k === 0 ? blue : c.tied ? '#e0b13a' : '#9fb3c6', strong: report.named && k === 0})), {left: Math.min(0.55 * box.clientWidth, Math.max(120, 12 + 6.1 * Math.max(...list.map(c => c.name.length)))), right: 84, each: 19, foot: 17});
      const line = (gain, colour, text, anchor) => {
        draw(b.s, 'line', {x1: b.x(gain / best), x2: b.x(gain / best), y1: 0, y2: b.height, stroke: colour, 'stroke-dasharray': '3 2'});
        if (text) draw(b.s, 'text', {x: b.x(gain / best), y: b.height + 12, class: anchor}, text);
      };
      if (report.named) {
        const from = Math.max(0, list[0].gain - report.tie) / best;
        const band = draw(b.s, 'rect', {x: Math.min(b.x(from), b.x(list[0].gain / best) - 3), y: 0, width: Math.max(3, b.x(list[0].gain / best) - b.x(from)), height: b.height, fill: '#e0a100', 'fill-opacity': 0.4});
        hint(band, `within ${report.tie} of the best: cannot be told apart`);
        line(report.detected, '#66707c', 'chance; yellow: not told apart', '');
      } else {
        line(report.detected, red, 'what chance does not reach', b.x(report.detected / best) < 170 ? '' : 'end');
      }
    } else {
      make(box, 'p', report.verdict === 'NO_MISMATCH' ? 'Nothing is left that any mechanism of the catalogue would gain on.' : 'No mechanism was fitted.', 'why');
    }
    report.mechanisms.forEach((m, k) => {
      const into = k === 0 ? box : make(box, 'details');
      if (k > 0) make(into, 'summary', bare(m.name), 'why');
      make(into, 'p', signs(m.because), 'why');
    });
  };

  // --- what remains, what to do
  const drawRemains = () => {
    const box = get('remains');
    box.textContent = '';
    if (report.named || report.verdict === 'UNKNOWN') {
      const width = Math.max(240, box.clientWidth), s = svg(box, width, 42), explained = report.named ? Math.max(0, Math.min(1, report.remains.explained)) : 0, cut = width * explained;
      draw(s, 'rect', {x: 0, y: 0, width: width, height: 18, fill: '#e9b9bf'});
      draw(s, 'rect', {x: 0, y: 0, width: cut, height: 18, fill: blue});
      if (explained > 0.25) draw(s, 'text', {x: 6, y: 13, style: 'fill:#fff'}, percent(explained) + ' of the mismatch explained');
      if (explained < 0.75) draw(s, 'text', {x: width - 6, y: 13, class: 'end'}, percent(1 - explained) + ' open');
      draw(s, 'text', {x: 0, y: 35}, mv(report.remains.rmse_mv) + ' RMS remain; a healthy cell leaves up to ' + mv(report.floor_mv) + '.');
    } else if (report.error_mv !== null) {
      make(box, 'p', mv(report.error_mv) + ' RMS between recording and cell file' + (report.floor_mv > 0 ? '; a healthy cell leaves up to ' + mv(report.floor_mv) : '') + '.', 'why');
    }
    if (report.next) make(box, 'p', [report.next.why, report.next.instruction, report.next.command].join(' '), 'action');
    report.mechanisms.forEach(m => {
      const p = make(box, 'p', undefined, 'action');
      make(p, 'b', bare(m.name) + ': ');
      p.appendChild(document.createTextNode(m.meaning + ' ' + m.action + (m.rivals.length ? ' Not told apart from ' + m.rivals.join(', ') + '.' : '')));
    });
    if (report.not_testable.length && report.verdict !== 'NOT_TESTABLE') make(box, 'p', report.not_testable.length + ' of ' + (report.not_testable.length + report.limits.length) + ' mechanisms could not be judged with these recordings; they are listed below.', 'why');
  };

  // --- regimes
  const drawRegimes = () => {
    const row = get('regimes');
    row.textContent = '';
    get('figure-regimes').hidden = !report.regimes.length;
    const boxes = report.regimes.map(() => make(row, 'div'));  // all of them before any is measured
    for (const [n_axis, axis] of report.regimes.entries()) {
      const box = boxes[n_axis], width = Math.max(220, box.clientWidth), high = 104, left = 30, top = 18, s = svg(box, width, top + high + 30);
      const most = Math.max(1, ...axis.before_mv.filter(Number.isFinite), ...axis.after_mv.filter(Number.isFinite)), n = axis.before_mv.length, wide = (width - left - 4) / n;
      const x = v => left + (width - left - 4) * (v - axis.low) / (axis.high - axis.low), y = v => top + high - high * v / most;
      draw(s, 'text', {x: 0, y: 11, class: 'strong'}, axis.title + ', ' + axis.unit);
      if (axis.found) {
        hint(draw(s, 'rect', {x: x(axis.found.from), y: top, width: Math.max(2, x(axis.found.to) - x(axis.found.from)), height: high, fill: sand}), percent(axis.found.share) + ' of the mismatch in ' + percent(axis.found.usual) + ' of the time');
        draw(s, 'text', {x: width, y: 11, class: 'end'}, percent(axis.found.share) + ' of it in ' + percent(axis.found.usual) + ' of the time');
      }
      const longest = Math.max(...axis.time);
      axis.before_mv.forEach((v, k) => {
        if (v === null) return;
        const solid = 0.25 + 0.75 * Math.sqrt(axis.time[k] / longest);
        hint(draw(s, 'rect', {x: left + k * wide + 0.5, y: y(v), width: wide - 1, height: top + high - y(v), fill: red, 'fill-opacity': solid}), mv(v) + ', ' + (100 * axis.time[k]).toFixed(1) + ' % of the time');
        if (axis.after_mv[k] !== null) draw(s, 'rect', {x: left + k * wide + 0.5, y: y(axis.after_mv[k]), width: wide - 1, height: top + high - y(axis.after_mv[k]), fill: blue, 'fill-opacity': solid});
      });
      draw(s, 'line', {x1: left, x2: width - 4, y1: top + high, y2: top + high, stroke: '#66707c'});
      for (const t of ticks(0, most, 3)) draw(s, 'text', {x: left - 4, y: y(t) + 4, class: 'end'}, t);
      const marks = axis.logarithmic ? [1, 10, 100, 1000, 10000].filter(t => Math.log10(t) >= axis.low && Math.log10(t) <= axis.high) : ticks(axis.low, axis.high, 5);
      for (const t of marks) draw(s, 'text', {x: x(axis.logarithmic ? Math.log10(t) : t), y: top + high + 14, class: 'middle'}, t);
      draw(s, 'text', {x: 0, y: top + 10}, 'mV');
    }
  };

  const drawLimits = () => {
    get('limits').textContent = '';
    get('figure-limits').hidden = !report.limits.length;
    if (report.limits.length) make(get('limits'), 'p', 'The smallest effect found in 9 of 10 recordings like these. Bars: part of what is possible at all, logarithmic.', 'why');
    if (report.limits.length) bars(get('limits'), limitRows(report.limits), {left: 260, right: 84, each: 19});
    get('not-testable').textContent = '';
    get('figure-not-testable').hidden = !report.not_testable.length;
    const reasons = new Map();
    for (const n of report.not_testable) reasons.set(n.reason, (reasons.get(n.reason) || []).concat(bare(n.name)));
    const list = make(get('not-testable'), 'ul', undefined, 'reasons');
    for (const [reason, names] of reasons) {
      const item = make(list, 'li');
      make(item, 'b', sentence(reason) + ': ');
      item.appendChild(document.createTextNode(names.join(', ')));
    }
  };

  const drawAll = () => [drawStrip, drawMuch, drawBeforeAfter, drawWhy, drawRemains, drawRegimes, drawLimits].forEach(f => f());
  drawAll();
  let later = 0;
  window.addEventListener('resize', () => { clearTimeout(later); later = setTimeout(drawAll, 150); });

  // --- curves
  window.charts = [];
  for (const c of report.charts) {
    const rows = series => c.time_s.map((t, k) => [t / 3600, ...series.map(v => v[k])]);
    const chart = (title, labels, series, colours, tall) => {
      const box = make(get('curves'), 'figure'), caption = make(box, 'figcaption', title + ' '), legend = make(caption, 'span', '', 'legend');
      return new Dygraph(make(box, 'div', undefined, tall ? 'chart tall' : 'chart'), rows(series), {
        labels: ['time', ...labels], labelsDiv: legend, legend: 'always', colors: colours, axisLabelFontSize: 12, gridLineColor: '#e3e8ee', strokeWidth: 1.2,
        digitsAfterDecimal: 4, axes: {x: {axisLabelFormatter: clock, valueFormatter: clock}, y: {axisLabelWidth: 58, pixelsPerLabel: 24}},
      });
    };
    const name = c.name + (c.holdout ? ', not used in the diagnosis' : '');
    const both = c.extended_v !== undefined;
    const pair = [
      chart('Voltage, open loop: ' + name, both ? ['cell file, V', 'extended, V', 'measured, V'] : ['cell file, V', 'measured, V'], both ? [c.base_v, c.extended_v, c.measured_v] : [c.base_v, c.measured_v],
            both ? [red, blue, '#2a2f36'] : [red, '#2a2f36'], true),
      chart('Measured less simulated: ' + name, both ? ['cell file, mV', 'extended, mV'] : ['cell file, mV'], both ? [c.before_mv, c.after_mv] : [c.before_mv], both ? [red, blue] : [red], false),
    ];
    Dygraph.synchronize(pair, {selection: true, zoom: true, range: false});
    window.charts.push(...pair);
  }
})();
