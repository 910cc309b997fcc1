// Draws the page from `report`: {title, statement, warnings, sections: [{title, note, table: {head, rows: [[{text,
// paper}]]}} | {title, chart: {labels, rows, x, bands}}]}. x: title of the axis if it is not the time.
(() => {
  'use strict';
  const {make, get, chart, warnings} = drawing;
  document.getElementById('title').textContent = report.title;
  document.getElementById('statement').textContent = report.statement;
  warnings(get('warnings'), report.warnings);
  const sections = document.getElementById('sections');
  window.charts = [];
  for (const section of report.sections) {
    const box = make(sections, 'figure');
    const caption = make(box, 'figcaption', section.title + ' ');
    if (section.table) {
      const table = make(box, 'table', undefined, 'wide');
      const head = table.insertRow();
      head.className = 'group';
      for (const name of section.table.head) make(head, 'td', name);
      for (const row of section.table.rows) {
        const tr = table.insertRow();
        for (const cell of row) {
          const td = make(tr, 'td', cell.text);
          if (cell.paper !== undefined) make(td, 'span', ' paper ' + cell.paper, 'paper');
        }
      }
    } else {
      const legend = make(caption, 'span', '', 'legend');
      const div = make(box, 'div', undefined, 'chart tall');
      const {labels, rows, x, bands} = section.chart;
      window.charts.push(chart(div, labels, rows, legend, {x, customBars: bands, drawPoints: x !== undefined}));
    }
    if (section.note) make(box, 'p', section.note, 'note');
  }
})();
