// Draws the page from `report`: {title, statement, warnings, figures: [[name, value] | [group]], columns: {...}}.
(() => {
  'use strict';
  const {colour, get, warnings} = drawing;
  document.getElementById('title').textContent = report.title;
  document.getElementById('statement').textContent = report.statement;
  warnings(get('warnings'), report.warnings);

  const table = document.getElementById('figures');
  for (const row of report.figures) {
    const tr = table.insertRow();
    if (row.length === 1) tr.className = 'group';
    row.forEach((text, k) => {
      const td = tr.insertCell();
      td.textContent = text;
      if (row.length === 1) td.colSpan = 2;
    });
  }

  const c = report.columns;
  const hours = c.time_s.map(t => t / 3600);
  const rows = series => hours.map((h, k) => [h, ...series.map(f => f(k))]);
  const at = column => k => column[k];
  const band = (middle, half) => k => [100 * (middle[k] - half[k]), 100 * middle[k], 100 * (middle[k] + half[k])];

  const chart = (name, labels, data, options) =>
      drawing.chart(get('chart-' + name), labels, data, get('legend-' + name), options);

  const in_percent = {
    x: drawing.time_axis,
    y: {axisLabelWidth: 58, pixelsPerLabel: 24, valueFormatter: v => v.toFixed(2)}
  };
  // a range that a wrong initial estimate does not widen: at most 1.5 times that of 99.5 % of the values
  const range = values => {
    const sizes = values.filter(Number.isFinite).map(Math.abs).sort((a, b) => a - b);
    if (sizes.length === 0) return null;
    const most = Math.min(sizes[sizes.length - 1], 1.5 * sizes[Math.floor(0.995 * (sizes.length - 1))]);
    return most > 0 ? [-1.05 * most, 1.05 * most] : null;
  };
  const soc_labels = ['estimate with two sigma, %'], soc_series = [band(c.soc, c.two_sigma)];
  if (c.soc_ref) {
    soc_labels.push('reference, %');
    soc_series.push(k => c.soc_ref[k] === null ? [null, null, null] : Array(3).fill(100 * c.soc_ref[k]));
  }
  // where the log's own state of charge differs from a count of its current: a dashed line with the kind
  const marks = (context, area, graph) => {
    context.save();
    context.strokeStyle = context.fillStyle = colour('reference');
    context.setLineDash([4, 3]);
    for (const [hour, kind] of report.marks || []) {
      const x = graph.toDomXCoord(hour);
      if (x < area.x || x > area.x + area.w) continue;
      context.beginPath();
      context.moveTo(x, area.y);
      context.lineTo(x, area.y + area.h);
      context.stroke();
      context.fillText(kind, x + 3, area.y + 10);
    }
    context.restore();
  };
  const charts = [
    chart('soc', soc_labels, rows(soc_series), {customBars: true, axes: in_percent, underlayCallback: marks}),
    chart(
        'voltage', ['predicted one step ahead, V', 'open loop, V', 'measured, V'],
        rows([at(c.predicted_v), at(c.open_loop_v), at(c.voltage_v)])),
    chart('current', ['measured, A'], rows([at(c.current_a)]), {fillGraph: true, fillAlpha: 0.15}),
    chart(
        'innovation', ['mV'], rows([at(c.innovation_mv)]),
        {colors: [colour('other')], valueRange: range(c.innovation_mv)}),
  ];
  if (c.soc_ref) {
    // the error should stay within the filter's own band around zero
    const zeros = c.soc.map(() => 0),
          error = k => c.soc_ref[k] === null ? [null, null, null] : Array(3).fill(100 * (c.soc[k] - c.soc_ref[k]));
    charts.push(chart('error', ['two sigma, %', 'error, %'], rows([band(zeros, c.two_sigma), error]), {
      customBars: true,
      colors: [colour('model'), colour('reference')],
      axes: in_percent,
      fillAlpha: 0.3,
      valueRange: range(c.soc.map((v, k) => 100 * Math.max(Math.abs(v - c.soc_ref[k]), c.two_sigma[k])))
    }));
  } else {
    document.getElementById('figure-error').remove();
  }
  Dygraph.synchronize(charts, {selection: true, zoom: true, range: false});
  window.charts = charts;
})();
