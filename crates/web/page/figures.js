// Prometheus' text form, as far as the server writes it. Pure.

const LINE = /^([a-zA-Z_:][\w:]*)(?:\{(.*)\})? (\S+)$/;
const LABEL = /(\w+)="((?:[^"\\]|\\.)*)"/g;

export function readFigures(text) {
  const figures = [];
  for (const line of text.split("\n")) {
    const parts = line.startsWith("#") ? null : LINE.exec(line);
    if (!parts) continue;
    const labels = Object.fromEntries([...(parts[2] ?? "").matchAll(LABEL)].map(([, name, value]) => [name, value]));
    figures.push({ name: parts[1], labels, value: Number(parts[3].replace("+Inf", "Infinity")) });
  }
  return figures;
}

// The one figure of a name with these labels; 0 if there is none.
export function figure(figures, name, labels = {}) {
  const fits = (of) => of.name === name && Object.entries(labels).every(([label, value]) => of.labels[label] === value);
  return figures.find(fits)?.value ?? 0;
}

// Values by one label.
export function byLabel(figures, name, label) {
  return new Map(
    figures.filter((of) => of.name === name && label in of.labels).map((of) => [of.labels[label], of.value]),
  );
}

// Buckets of a histogram, each for itself: upper ends and counts.
export function buckets(figures, name, labels) {
  const of = figures.filter(
    (line) =>
      line.name === `${name}_bucket` && Object.entries(labels).every(([label, value]) => line.labels[label] === value),
  );
  const ends = of
    .map((line) => [Number(line.labels.le.replace("+Inf", "Infinity")), line.value])
    .sort((a, b) => a[0] - b[0]);
  return ends.map(([upto, count], index) => ({ upto, count: count - (index ? ends[index - 1][1] : 0) }));
}

// The end of the bucket in which the quantile lies; null without anything counted.
export function quantile(counted, share) {
  const total = counted.reduce((sum, { count }) => sum + count, 0);
  let passed = 0;
  for (const { upto, count } of counted) {
    passed += count;
    if (total && passed >= share * total) return upto;
  }
  return null;
}
