// Lines, signs and labels, of which everything on the map is drawn.

const WIDE = 2 * Math.PI;

/** A line from place to place. */
export function path(canvas, view, positions) {
  canvas.beginPath();
  positions.forEach((position, index) => {
    const [x, y] = view.spot(position);
    if (index) canvas.lineTo(x, y);
    else canvas.moveTo(x, y);
  });
  canvas.stroke();
}

/** A line from spot to spot. */
export function line(canvas, fromX, fromY, toX, toY) {
  canvas.beginPath();
  canvas.moveTo(fromX, fromY);
  canvas.lineTo(toX, toY);
  canvas.stroke();
}

/** A circle, filled and drawn. */
export function disc(canvas, x, y, radius) {
  canvas.beginPath();
  canvas.arc(x, y, radius, 0, WIDE);
  canvas.fill();
  canvas.stroke();
}

/** A circle around what is meant. */
export function ring(canvas, x, y, radius, colour) {
  canvas.strokeStyle = colour;
  canvas.lineWidth = 2;
  canvas.beginPath();
  canvas.arc(x, y, radius, 0, WIDE);
  canvas.stroke();
}

/** What is done. */
export function tick(canvas, x, y, radius, colour) {
  canvas.strokeStyle = colour;
  canvas.lineWidth = 1.75;
  canvas.beginPath();
  canvas.moveTo(x - radius * 0.45, y + radius * 0.05);
  canvas.lineTo(x - radius * 0.1, y + radius * 0.4);
  canvas.lineTo(x + radius * 0.5, y - radius * 0.4);
  canvas.stroke();
}

/** What failed, or where two come near. */
export function cross(canvas, x, y, half) {
  canvas.beginPath();
  canvas.moveTo(x - half, y - half);
  canvas.lineTo(x + half, y + half);
  canvas.moveTo(x + half, y - half);
  canvas.lineTo(x - half, y + half);
  canvas.stroke();
}

/** A UAV that heads there [rad; clockwise from north]; traced, not drawn. */
export function arrow(canvas, size, heading) {
  const turned = (across, ahead) => [
    across * Math.cos(heading) + ahead * Math.sin(heading),
    across * Math.sin(heading) - ahead * Math.cos(heading),
  ];
  canvas.beginPath();
  canvas.moveTo(...turned(0, size));
  canvas.lineTo(...turned(0.75 * size, -0.8 * size));
  canvas.lineTo(...turned(0, -0.4 * size));
  canvas.lineTo(...turned(-0.75 * size, -0.8 * size));
  canvas.closePath();
}

/** Two bars: a UAV that is held. */
export function bars(canvas, size, ink) {
  canvas.fillStyle = ink.text;
  canvas.fillRect(-size - 7, -5, 3, 10);
  canvas.fillRect(-size - 2, -5, 3, 10);
}

/** Text that stands out from whatever is below. */
export function label(canvas, text, x, y, colour, look) {
  canvas.lineJoin = "round";
  canvas.lineWidth = 3;
  canvas.strokeStyle = look.ink.ground;
  canvas.strokeText(text, x, y);
  canvas.fillStyle = colour;
  canvas.fillText(text, x, y);
}
