// Reads /events (host_sim/monitor/live_page.hpp): the last state goes into the tiles and the table, its points into the
// plots.
(() => {
  'use strict';
  const {get, make, svg, draw, red, blue, green, dark, faint} = drawing;
  const most = 7200, shown_cells = 32;
  const known = v => v !== null && v !== undefined;
  const fixed = (v, digits, unit) => (known(v) ? v.toFixed(digits) : '–') + (unit ? '\u202f' + unit : '');
  const percent = (v, digits) => fixed(known(v) ? 100 * v : null, digits, '%');
  const two = n => String(n).padStart(2, '0');
  const clock = t => {
    const s = Math.round(t);
    return Math.floor(s / 3600) + ':' + two(Math.floor(s / 60) % 60) + ':' + two(s % 60);
  };

  // --- plots
  const points = [];
  const time_axis = {axisLabelFormatter: clock, valueFormatter: clock};
  const rows = {
    soc: p => [p[0], known(p[1]) ? [p[1] - p[2], p[1], p[1] + p[2]] : [null, null, null]],
    current: p => [p[0], p[3]],
    voltage: p => [p[0], p[4]],
    temperature: p => [p[0], p[5]],
    cells: p => [p[0], ...Array.from({length: cell_count}, (_, k) => known(p[6 + k]) ? p[6 + k] : null)],
  };
  let cell_count = 0;
  const charts = {};
  const chart = (name, labels, options, digits) => {
    charts[name] = new Dygraph(
        get('chart-' + name), [rows[name]([0, ...Array(5 + shown_cells).fill(null)])],
        Object.assign(
            {
              labels: ['time', ...labels],
              labelsDiv: get('legend-' + name),
              legend: 'always',
              axisLabelFontSize: 12,
              gridLineColor: faint,
              xlabel: 'time, h:mm:ss',
              xLabelHeight: 15,
              strokeWidth: 1.5,
              connectSeparatedPoints: false,
              axes: {x: time_axis, y: {axisLabelWidth: 58, pixelsPerLabel: 24, valueFormatter: v => v.toFixed(digits)}}
            },
            options));
  };
  chart('soc', ['%'], {customBars: true, colors: [blue], fillAlpha: 0.22}, 2);
  chart('current', ['A'], {colors: [dark], fillGraph: true, fillAlpha: 0.15}, 2);
  chart('voltage', ['V'], {colors: [dark]}, 3);
  chart('temperature', ['\u00b0C'], {colors: [dark]}, 1);
  const start_cells = count => {
    cell_count = count;
    get('figure-cells').hidden = false;
    if (charts.cells) charts.cells.destroy();
    const colour = k => `hsl(${(205 + 137.5 * k) % 360} 55% 42%)`;
    chart(
        'cells', Array.from({length: count}, (_, k) => String(k + 1)),
        {colors: Array.from({length: count}, (_, k) => colour(k)), legend: 'onmouseover', strokeWidth: 1.1}, 3);
  };
  // the range of the values, at least `least` wide, so that small changes do not fill the chart
  const around = (column, least) => {
    let low = Infinity, high = -Infinity;
    for (const p of points)
      for (const v of column(p))
        if (known(v)) {
          low = Math.min(low, v);
          high = Math.max(high, v);
        }
    if (low > high) return null;
    const middle = (low + high) / 2, half = Math.max(0.55 * (high - low), least / 2);
    return [middle - half, middle + half];
  };
  const ranges = {
    soc: () => {
      const r = around(p => known(p[1]) ? [p[1] - p[2], p[1] + p[2]] : [], 2);
      return r && [Math.max(r[0], -2), Math.min(r[1], 102)];
    },
    current: () => around(p => [p[3], 0], 2),
    voltage: () => around(p => [p[4]], 0.1),
    temperature: () => around(p => [p[5]], 2),
    cells: () => around(p => p.slice(6, 6 + cell_count), 0.02)
  };
  const redraw = () => {
    for (const name in charts) {
      if (charts[name].isZoomed()) continue;
      charts[name].updateOptions({file: points.map(rows[name]), valueRange: ranges[name]()});
    }
  };

  // --- picture
  const stale = (id, is) => get(id).closest('.tile').classList.toggle('stale', is);
  const pairs = (id, list) => {
    get(id).replaceChildren();
    for (const [name, value] of list) {
      make(get(id), 'span', name);
      make(get(id), 'b', value);
    }
  };
  const soc_bar = pack => {
    const box = get('soc-bar');
    box.replaceChildren();
    const s = svg(box, 400, 16, {preserveAspectRatio: 'none'});
    draw(s, 'rect', {x: 0, y: 3, width: 400, height: 10, rx: 2, fill: faint});
    if (!known(pack.soc)) return;
    const x = v => 400 * Math.max(0, Math.min(1, v)), half = 2 * (pack.soc_sigma || 0);
    draw(s, 'rect', {x: 0, y: 3, width: x(pack.soc), height: 10, rx: 2, fill: blue, 'fill-opacity': 0.75});
    draw(s, 'rect', {
      x: x(pack.soc - half),
      y: 1,
      width: Math.max(2, x(pack.soc + half) - x(pack.soc - half)),
      height: 14,
      fill: '#7fb2e5',
      'fill-opacity': 0.75
    });
    draw(s, 'rect', {x: x(pack.soc) - 1, y: 0, width: 2, height: 16, fill: dark});
  };
  const cell_bars = cells => {
    const there = cells.filter(known);
    get('figure-bars').hidden = there.length === 0;
    if (there.length === 0) return;
    const high = Math.max(...there), low = Math.min(...there), span = Math.max(0.05, 1.25 * (high - low)),
          from = high - span;
    get('delta').textContent =
        `min ${low.toFixed(3)} V, max ${high.toFixed(3)} V, delta ${(1000 * (high - low)).toFixed(0)} mV`;
    const spread_v = 0.02;  // a smaller one is healthy
    const colour = v => {
      if (high - low < spread_v) return blue;
      if (v === low) return '#c9772b';
      return v === high ? green : blue;
    };
    const box = get('bars');
    box.replaceChildren();
    const s = svg(box, 400, 17 * cells.length + 2);
    cells.forEach((v, k) => {
      draw(s, 'text', {x: 22, y: 17 * k + 13, class: 'end'}, String(k + 1));
      draw(s, 'rect', {x: 30, y: 17 * k + 3, width: 300, height: 12, rx: 2, fill: faint});
      if (!known(v)) return;
      draw(s, 'rect', {
        x: 30,
        y: 17 * k + 3,
        width: Math.max(1, 300 * (v - from) / span),
        height: 12,
        rx: 2,
        fill: colour(v),
        'fill-opacity': 0.8
      });
      draw(s, 'text', {x: 398, y: 17 * k + 13, class: 'end'}, v.toFixed(3) + ' V');
    });
  };
  const age = s => {
    if (!known(s)) return '–';
    if (s < 9.95) return s.toFixed(1) + ' s';
    return s < 100 ? s.toFixed(0) + ' s' : (s / 60).toFixed(0) + ' min';
  };
  const message_table = (messages, silent_s) => {
    const table = get('messages');
    table.replaceChildren();
    const head = table.insertRow();
    for (const name of ['Message', 'per s', 'age', 'frames', 'lost', 'CRC']) make(head, 'th', name);
    for (const name in messages) {
      const m = messages[name], row = table.insertRow();
      if (m.stale) row.className = 'stale';
      [name, fixed(m.rate_hz, 1), age(known(m.age_s) ? m.age_s + silent_s : null), m.frames, m.lost,
       m.crc_errors + m.wrong_length]
          .forEach((text, k) => {
            const cell = make(row, 'td', String(text));
            if (k >= 4 && text > 0) cell.className = 'wrong';
          });
    }
  };
  const alarm = pack => {
    const box = get('alarm'), faults = pack.faults || [];
    box.hidden = faults.length === 0;
    box.replaceChildren();
    const list = make(box, 'ul');
    for (const text of faults) make(list, 'li', text);
    if (faults.length > 0) make(list, 'li', pack.fault_details.join(' · ')).className = 'detail';
  };
  const show = p => {
    const pack = p.pack, current = pack.current_a;
    get('source').textContent = p.source;
    get('bus').textContent =
        `${clock(p.duration_s)} · ${p.frames} frames · ${p.frames_per_second.toFixed(0)} per second` +
        (p.dropped ? ` · ${p.dropped} dropped` : '') + (p.malformed ? ` · ${p.malformed} malformed` : '');
    get('soc').textContent = percent(pack.soc, 1);
    get('sigma').textContent = known(pack.soc_sigma) ? '± ' + percent(2 * pack.soc_sigma, 1) : '';
    get('quality').textContent = [...new Set([pack.soc_quality, ...pack.flags])].filter(Boolean).join(' · ');
    soc_bar(pack);
    get('voltage').textContent = fixed(pack.voltage_v, 3, 'V');
    get('temperature').textContent = known(pack.temperature_c) ? fixed(pack.temperature_c, 1, '°C') : '';
    get('current').textContent = fixed(current, 2, 'A');
    const moving = known(current) && current !== 0, direction = current > 0 ? 'charging' : 'discharging';
    get('direction').textContent = [moving ? direction : '', pack.contactor[0]].filter(Boolean).join(' · ');
    get('direction').title = pack.contactor.join(' · ');
    pairs('limits', [
      ['discharge', fixed(pack.limits.discharge_now_a, 1, 'A')],
      ['for ten seconds', fixed(pack.limits.discharge_10s_a, 1, 'A')],
      ['charge', fixed(pack.limits.charge_now_a, 1, 'A')], ['for ten seconds', fixed(pack.limits.charge_10s_a, 1, 'A')]
    ]);
    const banded = (v, sigma) => percent(v, 1) + (known(sigma) ? ' ± ' + percent(2 * sigma, 1) : '');
    pairs('health', [
      ['capacity', banded(pack.health.capacity, pack.health.capacity_sigma)],
      ['resistance', banded(pack.health.resistance, pack.health.resistance_sigma)]
    ]);
    const is_stale = name => !p.messages[name] || p.messages[name].stale;
    stale('soc', is_stale('PackState'));
    for (const id of ['voltage', 'current']) stale(id, is_stale('PackElectrical'));
    stale('limits', is_stale('CurrentLimits'));
    stale('health', is_stale('Health'));
    alarm(pack);
    cell_bars(pack.cells_v);
    message_table(p.messages, p.silent_s);
    const ids = Object.entries(p.other_ids.ids).slice(0, 12).map(([id, n]) => `${id}: ${n}`).join(', ');
    get('others').textContent = p.other_ids.frames ? `Other ids: ${p.other_ids.frames} frames (${ids})` : '';
    if (p.source.startsWith('file:'))
      show_state('A log', '');
    else if (pack.stale)
      show_state('The BMS is silent', 'late');
    else if (p.silent_s > 3)
      show_state('The bus is silent', 'late');
    else
      show_state('Live', 'live');
  };
  const show_state = (text, name) => {
    get('state').textContent = text;
    get('state').className = name;
  };

  // --- events
  show_state('Connecting', '');
  let opened = false;
  const events = new EventSource('/events');
  events.onopen = () => {
    points.length = 0;
    opened = true;
  };  // a connection begins with the whole history
  events.onerror = () => show_state(opened ? 'The monitor has ended' : 'No connection', 'late');
  events.onmessage = message => {
    const {picture, points: more} = JSON.parse(message.data);
    for (const p of more) points.push(p);
    points.splice(0, Math.max(0, points.length - most));
    const cells = Math.min(shown_cells, Math.max(cell_count, ...more.map(p => p.length - 6), 0));
    if (cells > cell_count) start_cells(cells);
    show(picture);
    if (points.length > 0 && (more.length > 0 || message.lastEventId === '')) redraw();
  };
  window.charts = charts;
  window.points = points;
})();
