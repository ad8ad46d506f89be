// The height layers that a fleet shares, and in which of them each UAV is.

/** Index of the layer that a UAV is in or nearest to; null where its height is not known. */
export function layerOf(row, layers) {
  if (row.height_m === null || layers.length === 0) return null;
  const off = layers.map((height) => Math.abs(height - row.height_m));
  return off.indexOf(Math.min(...off));
}

/** How many UAVs in the air there are in each layer. */
export function countByLayer(rows, layers) {
  const counts = layers.map(() => 0);
  for (const row of rows) {
    const layer = row.height_m >= 1 ? layerOf(row, layers) : null;
    if (layer !== null) counts[layer] += 1;
  }
  return counts;
}
