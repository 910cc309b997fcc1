// Draws the page from `report` (host_sim/reports/fleet_page.cpp). Of the table of recordings only the visible rows
// exist.
(() => {
  'use strict';
  const {get, make, signs} = drawing;
  const all = report.recordings, row_px = 28, shown_rows = 24;
  const cell_name = c => report.cells[c][0] + (report.cells[c][1] ? ', cell ' + report.cells[c][1] : '');
  const date_of = day => new Date(1000 * (report.first_day_s + 86400 * day));
  const day_text = day => report.dated ? date_of(day).toISOString().slice(0, 10) : 'recording ' + (day + 1);
  /// Each part of a path is encoded: a folder's name is never the scheme or the query of an address.
  const address = path => (report.to_depot + '/' + path).split('/').map(encodeURIComponent).join('/');
  const link = (parent, path, text) => {
    const a = make(parent, 'a', text);
    a.href = address(path);
    return a;
  };
  const page_of = k => all.page[k] && 'pages/' + all.page[k].slice(0, 2) + '/' + all.page[k];

  get('title').textContent = report.title;
  get('statement').textContent = report.statement;

  // --- what to visit
  report.visits.forEach((v, n) => {
    const figure = make(get('visits'), 'figure', undefined, 'visit');
    const head = make(figure, 'figcaption');
    make(head, 'span', `${n + 1}. ${v.where}: ${v.what}`);
    const to = make(head, 'span', undefined, 'legend');
    if (v.page) link(to, v.page, 'clearest recording: ' + v.recording);
    make(figure, 'p', signs(v.why), 'note');
    make(figure, 'p', v.meaning, 'note');
    make(make(figure, 'p', undefined, 'note'), 'b', v.action);
  });

  const title_row = (t, head) => {
    const titles = t.insertRow();
    titles.className = 'group';
    for (const name of head) make(titles, 'td', name);
  };
  const table = (box, head, rows, most) => {
    const t = make(box, 'table', undefined, 'wide texts');
    title_row(t, head);
    for (const fill of rows.slice(0, most)) fill(t.insertRow());
    if (rows.length > most) make(box, 'p', `and ${rows.length - most} more`, 'hint');
  };
  get('figure-watch').hidden = !report.watch.length;
  if (report.watch.length)
    table(
        get('watch'), ['where', 'what', 'why'], report.watch.map(w => row => {
          const where = make(row, 'td');
          if (w.page)
            link(where, w.page, w.where);
          else
            where.textContent = w.where;
          make(row, 'td', w.what);
          make(row, 'td', signs(w.why));
        }),
        50);
  get('figure-forecasts').hidden = !report.forecasts.length && !report.limits.length;
  for (const sentence of report.limits) make(get('limits'), 'p', signs(sentence), 'note');
  const with_sigma = (v, s, unit) => `${v.toFixed(1)} \u00b1 ${s.toFixed(1)} ${unit}`;
  if (report.forecasts.length)
    table(
        get('forecasts'), ['cell', 'quantity', 'now', 'a month', 'limit reached'], report.forecasts.map(f => row => {
          make(row, 'td', cell_name(f.cell));
          make(row, 'td', f.what);
          make(row, 'td', with_sigma(f.now, f.now_sigma, '%'));
          make(row, 'td', with_sigma(f.per_month, f.per_month_sigma, '%'));
          make(row, 'td', f.when);
        }),
        50);

  // --- a cell over time; the recordings of a cell follow each other
  const first = [];
  all.cell.forEach((c, k) => {
    if (first[c] === undefined) first[c] = k;
  });
  window.charts = [];
  const chart = (id, title, value, sigma, from, to) => {
    const points = [];
    for (let k = from; k < to; ++k)
      if (value[k] !== null)
        points.push([report.dated ? date_of(all.day[k]) : all.day[k] + 1, [value[k] / 10, sigma[k] / 10]]);
    get(id).textContent = '';
    if (!points.length) {
      get(id).textContent = 'No reading of the ' + title + '.';
      return;
    }
    window.charts.push(new Dygraph(get(id), points, {
      labels: ['time', title + ', %'],
      errorBars: true,
      sigma: 1,
      drawPoints: true,
      pointSize: 3,
      strokeWidth: 1,
      xlabel: 'time',
      xLabelHeight: 15,
      ylabel: title + ', %',
      yLabelWidth: 18,
      axes: {y: {axisLabelWidth: 58}},
      axisLabelFontSize: 12,
      gridLineColor: drawing.faint,
      colors: [drawing.blue]
    }));
  };
  const show_cell = c => {
    window.charts = [];
    const to = c + 1 < report.cells.length ? first[c + 1] : all.cell.length;
    chart('resistance', 'change of the resistance', all.r, all.rs, first[c], to);
    chart('capacity', 'loss of capacity', all.q, all.qs, first[c], to);
  };
  report.cells.forEach((_, c) => { make(get('cell'), 'option', cell_name(c)).value = c; });
  get('cell').addEventListener('change', () => show_cell(+get('cell').value));
  const begin = report.visits.length ? report.visits[0].cell : 0;
  get('cell').value = begin;
  if (report.cells.length) show_cell(begin);

  // --- all recordings
  title_row(get('titles'), ['cell', 'date', 'verdict', 'finding, or the error']);
  let listed = [];
  const fill = () => {
    const top = Math.max(0, Math.floor(get('recordings').scrollTop / row_px) - 2), rows = get('rows');
    rows.textContent = '';
    rows.style.top = top * row_px + 'px';
    get('titles').style.width = get('recordings').clientWidth + 'px';  // less the scroll bar
    for (const k of listed.slice(top, top + shown_rows)) {
      const row = rows.insertRow(), name = make(row, 'td'), page = page_of(k), text = cell_name(all.cell[k]);
      if (page)
        link(name, page, text);
      else
        name.textContent = text;
      make(row, 'td', day_text(all.day[k]));
      make(row, 'td', all.verdicts[all.verdict[k]].replace(/_/g, ' '));
      make(row, 'td', all.texts[all.found[k]]).title = all.texts[all.found[k]];
    }
  };
  const list = () => {
    listed = [];
    for (let k = 0; k < all.cell.length; ++k)
      if (!get('only').checked || all.texts[all.found[k]] || all.verdicts[all.verdict[k]] === 'UNKNOWN') listed.push(k);
    get('count').textContent = `${listed.length} of ${all.cell.length}`;
    get('space').style.height = listed.length * row_px + 'px';
    get('recordings').scrollTop = 0;
    fill();
  };
  get('only').addEventListener('change', list);
  get('recordings').addEventListener('scroll', fill);
  window.addEventListener('resize', fill);
  list();
})();
