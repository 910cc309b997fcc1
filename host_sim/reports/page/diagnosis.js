// Draws the page from `report` (host_sim/reports/diagnosis_page.cpp): pictures as SVG, curves over time with dygraphs.
(() => {
  'use strict';
  const {get, make, draw, svg, hint, signs, percent, mv, red, blue, green, dark, grey} = drawing;
  const amber = '#a86a00', orange = '#e39a3b', pale_blue = '#7fa8cf', dashed = '3 2';
  const verdicts = {
    NO_MISMATCH: green,
    CAUSE: blue,
    CAUSES: blue,
    AMBIGUOUS: amber,
    UNKNOWN: '#7a4fb0',
    DATA_FAULT: '#b3261e',
    NOT_TESTABLE: grey,
    UNFINISHED: grey
  };
  const sentence = text => text.charAt(0).toUpperCase() + text.slice(1);
  /// The name of a mechanism without its article.
  const title_of = name => sentence(name.replace(/^(an?) /, ''));
  /// The text, cut to a width in pixels.
  const cut = (text, pixels) =>
      text.length * 6.1 > pixels ? text.slice(0, Math.max(3, Math.floor(pixels / 6.1) - 1)) + '\u2026' : text;

  const draw_head = () => {
    get('verdict').textContent = report.verdict.replace('_', ' ');
    get('verdict').style.background = verdicts[report.verdict];
    if (report.holdouts_beyond.length) {  // the verdict holds for the recordings alone
      get('verdict').textContent += ', HOLD-OUT DISAGREES';
      get('verdict').style.background = amber;
    }
    get('statement').textContent = signs(report.statement);
    get('subtitle').textContent = [report.subtitle, ...report.notes].join('; ');
    drawing.warnings(get('warnings'), report.warnings);
    const caption = id => get(id).previousElementSibling.firstChild;
    if (!report.named) caption('before-after').textContent = 'Compared with the noise floor ';
    if (!report.named) caption('why').textContent = 'Why no cause is named ';
  };

  // --- horizontal bars

  /// One bar: {name, hint, value, zero, low, high, text, colour, strong}; places are 0..1.
  const draw_bar = (s, r, x, y, options) => {
    const {left, room, width, stacked} = options;
    const name = {x: 0, y: stacked ? y - 9 : y + 4, class: r.strong ? 'strong' : ''};
    hint(draw(s, 'text', name, cut(r.name, stacked ? width : left - 6)), r.name + (r.hint ? ': ' + r.hint : ''));
    draw(s, 'rect', {x: left, y: y - 5, width: room, height: 10, fill: drawing.colour('head')});
    if (r.value !== null) {
      const from = x(r.zero || 0), to = x(r.value);
      const size = {x: Math.min(from, to), y: y - 5, width: Math.max(1.5, Math.abs(to - from)), height: 10};
      draw(s, 'rect', Object.assign(size, {fill: r.colour || blue}));
    }
    if (r.low !== undefined) {
      const style = {stroke: dark, 'stroke-width': 1.6};
      draw(s, 'line', Object.assign({x1: x(r.low), x2: x(r.high), y1: y, y2: y}, style));
      for (const end of [r.low, r.high])
        draw(s, 'line', Object.assign({x1: x(end), x2: x(end), y1: y - 4, y2: y + 4}, style));
    }
    draw(s, 'text', {x: width, y: y + 4, class: 'end'}, r.text);
  };
  /// options: {left, right: margins; each: height of a row}. Names that would leave no room for the bars stand above
  /// them.
  const bars = (box, rows, {left: least, right, each = 20}) => {
    const width = Math.max(240, box.clientWidth), longest = Math.max(0, ...rows.map(r => r.name.length));
    const names = 6.1 * longest + 12, most = width - right - 60, stacked = names > most;
    const left = stacked ? 0 : Math.min(most, Math.max(least, names)), room = width - left - right;
    const high = stacked ? each + 13 : each, s = svg(box, width, rows.length * high);
    const x = v => left + room * Math.max(0, Math.min(1, v));
    rows.forEach((r, k) => draw_bar(s, r, x, (k + 1) * high - each / 2, {left, room, width, stacked}));
    return {s, x, width, height: rows.length * high};
  };
  const limit_row = l => ({
    name: title_of(l.name),
    text: signs(l.text),
    value: 1 + Math.log10(Math.max(l.ratio, 1e-4)) / 4,
    colour: pale_blue,
    hint: l.id
  });

  // --- size

  const parameter_row = p => {
    const log = p.shape && p.low > 0;
    const place = v => log ? Math.log(v / p.low) / Math.log(p.high / p.low) : (v - p.low) / (p.high - p.low);
    const row = {
      name: p.name.replace(/_(v_per_k|j_per_mol|k_per_w|v|ohm|a|s|k|c)$/, '').replace(/_/g, ' '),
      text: signs(p.text) + (p.at_bound ? ' (bound)' : ''),
      value: p.given ? null : place(p.value),
      zero: !log && p.low < 0 ? place(0) : 0,
      hint: p.meaning,
      colour: pale_blue
    };
    if (p.deviation > 0 && !p.given) {
      row.low = place(Math.max(p.low, p.value - 2 * p.deviation));
      row.high = place(Math.min(p.high, p.value + 2 * p.deviation));
    }
    return row;
  };
  const draw_mechanism = (box, m, most) => {
    const many = report.mechanisms.length > 2;
    make(box, 'p', [title_of(m.name), ...m.rivals].join(', or '), 'subject');
    const share = {name: 'of the error', text: mv(m.rms_mv), value: m.rms_mv / most, colour: orange};
    share.hint = 'RMS on these recordings; the whole bar is the error of ' + mv(report.error_mv);
    const shown = m.parameters.filter(p => !(p.given && m.parameters.length > 2) && (!many || p.strength));
    bars(make(box, 'div'), [share, ...shown.map(parameter_row)], {left: 92, right: 122, each: many ? 18 : 21});
    for (const at of m.at_temperature) make(box, 'p', title_of(at) + '.', 'why');
  };
  const draw_size = () => {
    const box = get('much'), title = get('much-title');
    box.textContent = '';
    if (report.mechanisms.length) {
      const most = Math.max(report.error_mv || 0, ...report.mechanisms.map(m => m.rms_mv));
      for (const m of report.mechanisms) draw_mechanism(box, m, most);
      const orange_key = 'Orange: part of the error of ' + mv(report.error_mv) + ' RMS. ';
      make(box, 'p', orange_key + 'Blue: value within its possible range, with two standard deviations.', 'why');
    } else if (report.verdict === 'NO_MISMATCH') {
      title.textContent = 'Detection limits';
      bars(make(box, 'div'), report.limits.slice(0, 9).map(limit_row), {left: 168, right: 74, each: 21});
    } else if (report.faults.length) {
      title.textContent = 'Faults in the data';
      for (const fault of report.faults) make(box, 'p', fault, 'action');
    } else if (report.verdict === 'UNKNOWN') {
      const whole = {name: 'whole error', text: mv(report.error_mv), value: 1, colour: orange};
      const floor = {name: 'noise floor', text: mv(report.floor_mv), value: report.floor_mv / report.error_mv};
      bars(make(box, 'div'), [whole, Object.assign(floor, {colour: pale_blue})], {left: 130, right: 80});
      make(box, 'p', 'No known cause explains it, so nothing was added to the cell file.', 'why');
    } else {
      title.textContent = 'Why no statement is possible';
      make(box, 'p', signs(report.statement), 'action');
    }
  };

  // --- before and after

  /// Pairs of errors to compare, each with its own scale.
  const pairs_of_report = (room, x) => {
    const pairs = report.figures.map(f => ({title: f.name, before: f.before_mv, after: f.after_mv, at: x, text: mv}));
    if (!report.soc) return pairs;
    const top = 1.08 * Math.max(report.soc.before, report.soc.after);
    pairs.splice(1, 0, {
      title: 'estimated state of charge of the hold-out',
      before: report.soc.before,
      after: report.soc.after,
      at: v => 2 + (room - 62) * v / top,
      text: v => v.toFixed(2) + ' %',
      own: true
    });
    return pairs;
  };
  const cell_colour = report.named ? red : '#7a8794';
  const draw_pair = (s, p, y, width, floor_x, each) => {
    draw(s, 'text', {x: 2, y: y + 12, class: 'strong'}, cut(p.title, width - 20));
    const models = [[p.before, cell_colour, 'cell file']];
    if (report.named) models.push([p.after, blue, 'extended cell']);
    models.forEach(([v, colour, name], i) => {
      const size = {x: 2, y: y + 17 + 17 * i, width: Math.max(1.5, p.at(v) - 2), height: 14, fill: colour};
      hint(draw(s, 'rect', size), name);
      const end = p.at(v) + 5, covered = !p.own && floor_x > end - 4 && floor_x < end + 50;
      draw(s, 'text', {x: covered ? floor_x + 5 : end, y: y + 28 + 17 * i}, p.text(v));  // next to the floor's line
    });
    if (p.own || !(report.floor_mv > 0)) return;
    const line = {x1: floor_x, x2: floor_x, y1: y + 14, y2: y + each - 7, stroke: dark, 'stroke-dasharray': dashed};
    draw(s, 'line', line);
  };
  const draw_before_after = () => {
    const box = get('before-after');
    box.textContent = '';
    if (!report.figures.length) return make(box, 'p', 'No voltage to compare with.', 'why');
    const width = Math.max(240, box.clientWidth), room = width - 4;
    const most = 1.08 * Math.max(report.floor_mv, ...report.figures.flatMap(f => [f.before_mv, f.after_mv]));
    const x = v => 2 + (room - 62) * v / most, pairs = pairs_of_report(room, x);
    const each = report.named ? 58 : 42, s = svg(box, width, pairs.length * each + 18);
    pairs.forEach((p, k) => draw_pair(s, p, k * each, width, x(report.floor_mv), each));
    const y = pairs.length * each + 11;
    let from = 2;
    const key = (colour, text) => {
      draw(s, 'rect', {x: from, y: y - 9, width: 10, height: 10, fill: colour});
      draw(s, 'text', {x: from + 14, y: y}, text);
      from += 26 + 6 * text.length;
    };
    key(cell_colour, 'cell file');
    if (report.named) key(blue, 'extended');
    if (report.floor_mv > 0) draw(s, 'text', {x: from, y: y}, '\u2506 noise floor ' + mv(report.floor_mv));
    for (const text of report.intervals) make(box, 'p', text, 'why');
    if (report.has_holdout || !report.named) return;
    const p = make(box, 'p', 'There was no hold-out recording. To check the result, give a later one with ', 'why');
    make(p, 'code', '--holdout');
  };

  // --- reasons

  const candidate_row = (c, k, first, best) => {
    const gain = k > 0 && report.named ? '\u2212' + (first.gain - c.gain).toFixed(0) : c.gain.toFixed(0);
    const other = c.tied ? '#e0b13a' : '#9fb3c6', chosen = report.named && k === 0;
    return {
      name: c.name,
      text: gain + ' \u00b7 ' + percent(c.share),
      value: Math.max(0, c.gain) / best,
      colour: chosen ? blue : other,
      strong: chosen
    };
  };
  const draw_candidates = box => {
    const list = report.candidates.slice(0, 6), first = list[0], best = Math.max(1.25 * report.detected, first.gain);
    const rows = list.map((c, k) => candidate_row(c, k, first, best));
    const b = bars(box, rows, {left: 120, right: 84, each: 19});
    const limit_x = b.x(report.detected / best);
    const line = (colour, text) => {
      const style = {stroke: colour, 'stroke-dasharray': dashed};
      draw(b.s, 'line', Object.assign({x1: limit_x, x2: limit_x, y1: 0, y2: b.height}, style));
      make(box, 'p', text, 'why');
    };
    if (!report.named) return line(red, 'Dashed: threshold of significance.');
    const from = b.x(Math.max(0, first.gain - report.tie) / best), to = b.x(first.gain / best);
    const area = {x: Math.min(from, to - 3), y: 0, width: Math.max(3, to - from), height: b.height};
    const band = draw(b.s, 'rect', Object.assign(area, {fill: '#e0a100', 'fill-opacity': 0.4}));
    hint(band, `within ${report.tie} of the best: not distinguishable`);
    line(grey, 'Dashed: threshold of significance. Yellow: not distinguishable from the best.');
  };
  const draw_reasons = () => {
    const box = get('why');
    box.textContent = '';
    const none = report.verdict === 'NO_MISMATCH' ? 'No known cause would improve the model significantly.' :
                                                    'No mechanism was fitted.';
    if (report.candidates.length && report.verdict !== 'UNFINISHED')
      draw_candidates(box);
    else
      make(box, 'p', none, 'why');
    report.mechanisms.forEach((m, k) => {
      const into = k === 0 ? box : make(box, 'details');
      if (k > 0) make(into, 'summary', title_of(m.name), 'why');
      make(into, 'p', signs(m.because), 'why');
    });
  };

  // --- unexplained residual and next steps

  const floor_text = report.floor_mv > 0 ? '; a healthy cell causes up to ' + mv(report.floor_mv) : '';
  const draw_share = box => {
    const width = Math.max(240, box.clientWidth), s = svg(box, width, 18);
    const explained = report.named ? Math.max(0, Math.min(1, report.unexplained.explained)) : 0;
    draw(s, 'rect', {x: 0, y: 0, width: width, height: 18, fill: '#e9b9bf'});
    draw(s, 'rect', {x: 0, y: 0, width: width * explained, height: 18, fill: blue});
    const text = percent(explained) + ' of the mismatch explained';
    if (explained > 0.25) draw(s, 'text', {x: 6, y: 13, style: 'fill:#fff'}, text);
    const open = percent(1 - explained) + ' unexplained';
    if (explained < 0.75) draw(s, 'text', {x: width - 6, y: 13, class: 'end'}, open);
    const residual = mv(report.unexplained.rmse_mv) + ' RMS unexplained; a healthy cell causes up to ';
    const adjusted = 'Start and zero of the current sensor adjusted to these recordings, within their tolerance';
    make(box, 'p', residual + mv(report.floor_mv) + '.', 'why').title = adjusted;
  };
  const draw_unexplained = () => {
    const box = get('unexplained'), next = report.next, judged = report.limits.length;
    box.textContent = '';
    if (report.named || report.verdict === 'UNKNOWN')
      draw_share(box);
    else if (report.error_mv !== null)
      make(box, 'p', mv(report.error_mv) + ' RMS between recording and cell file' + floor_text + '.', 'why');
    for (const step of next) make(box, 'p', step, 'action');
    for (const m of report.mechanisms) {
      const p = make(box, 'p', undefined, 'action');
      make(p, 'b', title_of(m.name) + ': ');
      const rivals = m.rivals.length ? ' These recordings cannot distinguish it from ' + m.rivals.join(', ') + '.' : '';
      p.appendChild(document.createTextNode(m.meaning + ' ' + m.action + rivals));
    }
    const open = report.not_testable.length;
    if (!open || report.verdict === 'NOT_TESTABLE') return;
    const count = `${open} of ${open + judged} mechanisms`;
    make(box, 'p', count + ' cannot be judged with these recordings; they are listed below.', 'why');
  };

  // --- regimes, limits, curves

  const draw_regimes = () => {
    get('figure-regimes').hidden = !report.regimes.length;
    regimes(get('regimes'));
  };
  const draw_limits = () => {
    const box = get('limits'), list = get('not-testable');
    box.textContent = '';
    get('figure-limits').hidden = !report.limits.length;
    if (report.limits.length) {
      const first = 'The smallest effect that is found in 9 of 10 recordings like these. ';
      make(box, 'p', first + 'Bars: relative to the largest possible value, logarithmic.', 'why');
      bars(box, report.limits.map(limit_row), {left: 260, right: 84, each: 19});
    }
    list.textContent = '';
    get('figure-not-testable').hidden = !report.not_testable.length;
    const reasons = new Map();
    for (const n of report.not_testable) reasons.set(n.reason, (reasons.get(n.reason) || []).concat(title_of(n.name)));
    const items = make(list, 'ul', undefined, 'reasons');
    for (const [reason, names] of reasons) {
      const item = make(items, 'li');
      make(item, 'b', sentence(reason) + ': ');
      item.appendChild(document.createTextNode(names.join(', ')));
    }
  };
  const chart = (c, title, columns, tall) => {
    const box = make(get('curves'), 'figure'), caption = make(box, 'figcaption', title + ' ');
    const legend = make(caption, 'span', '', 'legend');
    const bands = columns.some(column => column.half);
    const value = (column, k) => {
      const v = column.values[k];
      if (!bands) return v;
      const half = column.half ? column.half[k] : 0;
      return v === null ? [null, null, null] : [v - half, v, v + half];
    };
    const rows = c.time_s.map((t, k) => [t / 3600, ...columns.map(column => value(column, k))]);
    return new Dygraph(make(box, 'div', undefined, tall ? 'chart tall' : 'chart'), rows, {
      labels: ['time', ...columns.map(column => column.label)],
      customBars: bands,
      labelsDiv: legend,
      legend: 'always',
      colors: columns.map(column => column.colour),
      axisLabelFontSize: 12,
      gridLineColor: drawing.faint,
      xlabel: drawing.time_title(rows[0][0], rows[rows.length - 1][0]),
      xLabelHeight: 15,
      strokeWidth: 1.2,
      digitsAfterDecimal: 4,
      axes: {x: drawing.time_axis, y: {axisLabelWidth: 58, pixelsPerLabel: 24}},
    });
  };
  const draw_curves = () => {
    window.charts = [];
    for (const c of report.charts) {
      const name = c.name + (c.holdout ? ', hold-out' : '');
      const volts = [{label: 'cell file, V', values: c.base_v, colour: red}];
      const errors = [{label: 'cell file, mV', values: c.before_mv, colour: red}];
      if (c.extended_v !== undefined) {
        volts.push({label: 'extended, V', values: c.extended_v, colour: blue});
        errors.push({label: 'extended, mV', values: c.after_mv, colour: blue});
      }
      if (c.half_width_v) {
        const last = volts[volts.length - 1], half = c.half_width_v.map(v => 1e3 * v);
        Object.assign(last, {label: last.label.replace(',', ' with its 95 % interval,'), half: c.half_width_v});
        errors.unshift({label: '95 % interval, mV', values: half.map(() => 0), half: half, colour: grey});
      }
      volts.push({label: 'measured, V', values: c.measured_v, colour: dark});
      const pair = [
        chart(c, 'Voltage, open loop: ' + name, volts, true),
        chart(c, 'Measured minus simulated voltage: ' + name, errors, false),
      ];
      Dygraph.synchronize(pair, {selection: true, zoom: true, range: false});
      window.charts.push(...pair);
    }
  };

  const draw_all = () => {
    strip(get('strip'), get('strip-note'));
    draw_size();
    draw_before_after();
    draw_reasons();
    draw_unexplained();
    learned_law(get('figure-law'), get('law'));
    draw_regimes();
    isolability(get('figure-isolability'), get('isolability'));
    draw_limits();
  };
  draw_head();
  draw_all();
  let timer = 0;
  window.addEventListener('resize', () => {
    clearTimeout(timer);
    timer = setTimeout(draw_all, 150);
  });
  draw_curves();
})();
