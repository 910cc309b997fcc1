// Draws the page from `report` (host_sim/reports/proof_page.cpp): every claim with its picture, then the plots of each
// experiment.
(() => {
  'use strict';
  const {get, make, draw, signs, ticks, red, blue, green, dark, faint} = drawing;
  const svg = (parent, width, height) => drawing.svg(parent, width, height, {style: `width:${width}px`});
  const amber = drawing.colour('amber');
  const curves = [blue, drawing.colour('other'), amber];
  /// About three digits.
  const short = v => {
    if (Math.abs(v) >= 100) return v.toFixed(0);
    return v.toFixed(Math.abs(v) >= 10 ? 1 : 2);
  };

  get('title').textContent = 'Diagnosis of real recordings, compared with measurements';
  get('statement').textContent = `${report.holding} of ${report.claims} claims hold.`;

  // --- a claim's picture
  const width = 190;
  const picture = (cell, c) => {
    if (c.number) {
      const n = c.number, reach = Math.max(3 * n.allowed, 1e-12),
            x = v => width / 2 + (width / 2 - 8) * Math.max(-1, Math.min(1, (v - n.measured) / reach));
      const s = svg(cell, width, 18);
      draw(s, 'line', {x1: 2, x2: width - 2, y1: 9, y2: 9, stroke: faint});
      draw(s, 'rect', {
        x: x(n.measured - n.allowed),
        y: 2,
        width: x(n.measured + n.allowed) - x(n.measured - n.allowed),
        height: 14,
        fill: green,
        'fill-opacity': 0.2
      });
      draw(s, 'line', {x1: width / 2, x2: width / 2, y1: 1, y2: 17, stroke: dark, 'stroke-width': 1.4});
      if (n.said === null) return;
      const out = Math.abs(n.said - n.measured) > reach, left = n.said < n.measured, at = x(n.said);
      draw(s, 'line', {
        x1: x(n.said - 2 * n.said_sigma),
        x2: x(n.said + 2 * n.said_sigma),
        y1: 9,
        y2: 9,
        stroke: c.holds ? blue : red,
        'stroke-width': 2
      });
      if (out)
        draw(s, 'path', {
          d: left ? `M${at + 7} 4 L${at} 9 L${at + 7} 14` : `M${at - 7} 4 L${at} 9 L${at - 7} 14`,
          fill: 'none',
          stroke: red,
          'stroke-width': 2
        });
      else
        draw(s, 'circle', {cx: at, cy: 9, r: 4, fill: c.holds ? blue : red});
    } else if (c.errors) {
      const e = c.errors, most = Math.max(e.before, e.after, 1e-9), x = v => (width - 4) * v / most,
            s = svg(cell, width, 18);
      draw(s, 'rect', {x: 2, y: 1, width: x(e.before), height: 7, fill: red});
      draw(s, 'rect', {x: 2, y: 10, width: x(e.after), height: 7, fill: blue});
      draw(s, 'line', {
        x1: 2 + x(e.allowed * e.before),
        x2: 2 + x(e.allowed * e.before),
        y1: 0,
        y2: 18,
        stroke: green,
        'stroke-width': 2
      });
    }
  };

  const colour = c => {
    if (c.verdict === 'holds') return green;
    return c.holds ? amber : red;
  };

  // --- all claims at a glance: a square each
  report.experiments.forEach((e, n) => {
    const row = make(get('glance'), 'div', undefined, 'glance');
    make(row, 'span', e.title);
    const s = svg(row, Math.max(20, 20 * e.claims.length), 18);
    e.claims.forEach((c, k) => {
      const link = draw(s, 'a', {href: `#claim-${n}-${k}`});
      const square = draw(link, 'rect', {x: 20 * k, y: 1, width: 16, height: 16, rx: 3, fill: colour(c)});
      draw(square, 'title', {}, `${c.claim}: ${signs(c.said)} (${c.verdict})`);
    });
    make(row, 'span', `${e.holding} of ${e.claims.length}`);
  });
  const yes_no = value => value ? 'yes' : 'no';
  const table = make(get('summary'), 'table', undefined, 'wide proof');
  const head = table.insertRow();
  head.className = 'group';
  for (const name
           of ['claim', 'result of the tool', 'measured independently', '', 'within its stated uncertainty', 'verdict'])
    make(head, 'td', name);
  for (const [n, e] of report.experiments.entries()) {
    const group = table.insertRow();
    group.className = 'group';
    make(group, 'td', e.title).colSpan = 5;
    make(group, 'td', `${e.holding} of ${e.claims.length}`);
    for (const [k, c] of e.claims.entries()) {
      const row = table.insertRow();
      row.id = `claim-${n}-${k}`;
      make(row, 'td', c.claim);
      make(row, 'td', signs(c.said));
      make(row, 'td', signs(c.measured));
      picture(make(row, 'td', undefined, 'picture'), c);
      make(row, 'td', c.within === null ? '' : yes_no(c.within));
      const verdict = make(row, 'td');
      make(verdict, 'b', c.verdict).style.color = colour(c);
      if (c.tolerance) make(verdict, 'span', 'tolerance: ' + signs(c.tolerance), 'paper');
    }
  }

  // --- the plots of an experiment
  const lines = (box, l) => {
    const figure = make(box, 'figure'), caption = make(figure, 'figcaption', l.title + ' '),
          legend = make(caption, 'span', '', 'legend');
    const measured = l.labels[0].startsWith('measured');
    return () => new Dygraph(make(figure, 'div', undefined, 'chart tall'), l.rows, {
             labels: ['time, ' + l.unit, ...l.labels],
             labelsDiv: legend,
             legend: 'always',
             colors: measured ? [dark, red, blue] : [red, blue],
             axisLabelFontSize: 12,
             gridLineColor: faint,
             strokeWidth: 1.2,
             digitsAfterDecimal: 4,
             axes: {x: {valueFormatter: x => x.toFixed(2) + ' ' + l.unit}, y: {axisLabelWidth: 58, pixelsPerLabel: 24}},
           });
  };
  const change = r => {
    if (2 * r.after <= r.before) return ', halved';
    return r.after > r.before ? ', increased' : '';
  };
  const bars = (box, b) => {
    const figure = make(box, 'figure');
    make(figure, 'figcaption', 'RMS ' + b.title);
    const wide = 560, left = 210, room = wide - left - 80,
          most = Math.max(1e-9, ...b.rows.flatMap(r => [r.before, r.after])),
          s = svg(figure, wide, 34 * b.rows.length + 20);
    b.rows.forEach((r, k) => {
      const y = 34 * k;
      draw(s, 'text', {x: 0, y: y + 18}, r.name);
      [[r.before, red], [r.after, blue]].forEach(([v, fill], i) => {
        draw(s, 'rect', {x: left, y: y + 2 + 14 * i, width: Math.max(1.5, room * v / most), height: 12, fill: fill});
        draw(
            s, 'text', {x: left + room * v / most + 5, y: y + 12 + 14 * i},
            short(v) + ' ' + b.unit + (i === 1 ? change(r) : ''));
      });
    });
    const y = 34 * b.rows.length + 14;
    draw(s, 'rect', {x: left, y: y - 9, width: 10, height: 10, fill: red});
    draw(s, 'text', {x: left + 14, y: y}, 'cell file');
    draw(s, 'rect', {x: left + 84, y: y - 9, width: 10, height: 10, fill: blue});
    draw(s, 'text', {x: left + 98, y: y}, 'extended');
  };
  const points = (box, p) => {
    const figure = make(box, 'figure');
    make(figure, 'figcaption', p.title);
    const wide = 560, high = 240, left = 56, bottom = 34, top = 12, s = svg(figure, wide, high + 18);
    const all = p.measured.concat(...p.predicted.map(c => c.points)).filter(q => q[1] !== null);
    if (!all.length) return make(figure, 'p', 'No data.', 'why');
    // a band that is much wider than its values may leave the picture
    const ys = all.flatMap(q => [q[1] - Math.min(q[2], Math.abs(q[1])), q[1] + Math.min(q[2], Math.abs(q[1]))]);
    let x0 = Math.min(...all.map(q => q[0])), x1 = Math.max(...all.map(q => q[0])), y0 = Math.min(0, ...ys),
        y1 = Math.max(...ys);
    x0 -= 0.04 * (x1 - x0) + 1e-9;
    x1 += 0.04 * (x1 - x0) + 1e-9;
    y1 += 0.05 * (y1 - y0) + 1e-9;
    const x = v => left + (wide - left - 8) * (v - x0) / (x1 - x0),
          y = v => top + (high - bottom - top) * (y1 - Math.max(y0, Math.min(y1, v))) / (y1 - y0);
    for (const t of ticks(y0, y1, 5)) {
      draw(s, 'line', {x1: left, x2: wide - 8, y1: y(t), y2: y(t), stroke: faint});
      draw(s, 'text', {x: left - 6, y: y(t) + 4, class: 'end'}, t);
    }
    const anchor = k => {
      if (k === 0) return '';
      return k + 1 === p.names.length ? 'end' : 'middle';
    };
    if (p.names.length)
      p.names.forEach(
          (name, k) => draw(s, 'text', {x: x(k + 1), y: high - bottom + 14 + 13 * (k % 2), class: anchor(k)}, name));
    else
      for (const t of ticks(x0, x1, 7)) draw(s, 'text', {x: x(t), y: high - bottom + 16, class: 'middle'}, t);
    draw(s, 'text', {x: wide - 8, y: high - 2, class: 'end'}, p.x);
    draw(s, 'text', {x: 0, y: 9}, p.y);
    const mark = (q, colour) => {
      whisker(q, colour);
      draw(s, 'circle', {cx: x(q[0]), cy: y(q[1]), r: 4, fill: colour});
    };
    const whisker = (q, stroke) => draw(s, 'line', {
      x1: x(q[0]),
      x2: x(q[0]),
      y1: y(q[1] - 2 * q[2]),
      y2: y(q[1] + 2 * q[2]),
      stroke: stroke,
      'stroke-width': 1.6
    });
    let key = left;
    const named = (text, fill) => {
      draw(s, 'circle', {cx: key + 4, cy: high + 10, r: 4, fill: fill});
      draw(s, 'text', {x: key + 12, y: high + 14}, text);
      key += 26 + 6.4 * text.length;
    };
    named('measured', dark);
    p.predicted.forEach((c, n) => {
      const stroke = curves[n % curves.length], q = c.points.filter(one => one[1] !== null);
      if (q.length > 10) {
        draw(s, 'polygon', {
          points: q.map(o => [x(o[0]), y(o[1] + 2 * o[2])])
                      .concat(q.map(o => [x(o[0]), y(o[1] - 2 * o[2])]).reverse())
                      .join(' '),
          fill: stroke,
          'fill-opacity': 0.15
        });
        draw(
            s, 'polyline',
            {points: q.map(o => [x(o[0]), y(o[1])]).join(' '), fill: 'none', stroke: stroke, 'stroke-width': 1.6});
      } else {
        for (const o of q) mark([o[0] + 0.012 * (x1 - x0), o[1], o[2]], stroke);
      }
      named(c.name, stroke);
    });
    for (const q of p.measured) mark(q, dark);
  };
  const later = [];
  for (const e of report.experiments) {
    const box = make(get('experiments'), 'section');
    make(box, 'h2', `${e.title}: ${e.holding} of ${e.claims.length} hold`);
    make(box, 'p', e.method, 'note');
    const row = make(box, 'div', undefined, 'pictures');
    e.points.forEach(p => points(row, p));
    e.bars.forEach(b => bars(row, b));
    e.lines.forEach(l => later.push(lines(row, l)));
    for (const note of e.notes) make(box, 'p', signs(note), 'why');
  }
  window.charts = later.map(show => show());  // after the boxes have their width

  const diagnoses = make(get('diagnoses'), 'table', undefined, 'wide proof');
  const titles = diagnoses.insertRow();
  titles.className = 'group';
  for (const name of ['cell file: recordings', 'verdict and findings', 'open loop, RMS', 's']) make(titles, 'td', name);
  for (const d of report.diagnoses) {
    const row = diagnoses.insertRow();
    make(row, 'td', d.name);
    const what = make(row, 'td');
    make(what, 'b', d.verdict.replace('_', ' '));
    for (const f of d.found) make(what, 'div', signs(f));
    make(row, 'td', `${short(d.before)} \u2192 ${short(d.after)} mV`);
    make(row, 'td', d.wall_s);
  }
})();
