// Draws the page from `report`: {title, statement, warnings, sections: [{title, note, table: {head, rows: [[{text,
// paper}]]}} | {title, chart: {labels, rows, x, bands, right}}]}. x: title of the axis if it is not the time. right:
// labels on an axis of their own.
(() => {
  'use strict';
  const {make, get, chart, warnings, signs} = drawing;
  document.getElementById('title').textContent = report.title;
  document.getElementById('statement').textContent = signs(report.statement);
  warnings(get('warnings'), report.warnings);
  const sections = document.getElementById('sections');
  window.charts = [];
  for (const section of report.sections) {
    const box = make(sections, 'figure');
    const caption = make(box, 'figcaption', signs(section.title) + ' ');
    if (section.table) {
      const table = make(box, 'table', undefined, 'wide');
      const head = table.insertRow();
      head.className = 'group';
      const is_words = cell => /[a-z]{4}/.test(cell.text);
      section.table.head.forEach((name, k) => {  // a title stands where the texts of its column begin
        const words = section.table.rows.some(row => row[k] && is_words(row[k]));
        make(head, 'td', signs(name), words ? 'words' : undefined);
      });
      for (const row of section.table.rows) {
        const tr = table.insertRow();
        for (const cell of row) {
          const td = make(tr, 'td', signs(cell.text), is_words(cell) ? 'words' : undefined);
          if (cell.paper !== undefined) make(td, 'span', ' paper ' + cell.paper, 'paper');
        }
      }
    } else {
      const legend = make(caption, 'span', '', 'legend');
      const div = make(box, 'div', undefined, 'chart tall');
      const {labels, rows, x, bands, right} = section.chart;
      const more = {x, customBars: bands, drawPoints: x !== undefined};
      if (right) {
        more.series = Object.fromEntries(right.map(label => [label, {axis: 'y2'}]));
        more.axes = {y2: {axisLabelWidth: 58, pixelsPerLabel: 24, independentTicks: true, drawGrid: false}};
      }
      window.charts.push(chart(div, labels, rows, legend, more));
    }
    if (section.note) make(box, 'p', section.note, 'note');
  }
})();
