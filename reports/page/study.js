// Draws the page from `report`: {title, statement, warnings, sections: [{title, note, table: {head, rows: [[{text,
// paper}]]}} | {title, chart: {labels, rows, right, x}}]}. right: labels on an axis of their own; x: label of the first
// value of each row.
(() => {
  'use strict';
  const {make} = drawing;
  document.getElementById('title').textContent = report.title;
  document.getElementById('statement').textContent = report.statement;
  document.getElementById('warnings').textContent = report.warnings.join(' \u00b7 ');
  const sections = document.getElementById('sections');
  const colors = ['#0b63b5', '#d1495b', '#2e7d4f', '#c9a227', '#7a4fb0', '#2a2f36'];
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
          const td = make(tr, 'td', cell.text, /[a-z]{4}/.test(cell.text) ? 'words' : undefined);
          if (cell.paper !== undefined) make(td, 'span', ' paper ' + cell.paper, 'paper');
        }
      }
    } else {
      const right = section.chart.right || [];
      const series = Object.fromEntries(right.map(label => [label, {axis: 'y2'}]));
      const legend = make(caption, 'span', '', 'legend');
      const div = make(box, 'div', undefined, 'chart tall');
      window.charts.push(new Dygraph(div, section.chart.rows, {
        labels: [section.chart.x || 'time, s', ...section.chart.labels],
        series: series,
        labelsDiv: legend,
        legend: 'always',
        colors: colors,
        axisLabelFontSize: 12,
        gridLineColor: '#e3e8ee',
        strokeWidth: 1.2,
        axes: {
          y: {axisLabelWidth: 58, pixelsPerLabel: 24},
          y2: {axisLabelWidth: 58, pixelsPerLabel: 24, independentTicks: true, drawGrid: false},
        },
      }));
    }
    if (section.note) make(box, 'p', section.note, 'note');
  }
})();
