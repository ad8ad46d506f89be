// Places: metres of the mission <-> degrees <-> the units Leaflet scales to pixels.

const SEMI_MAJOR_M = 6378137;
const ECCENTRICITY_SQUARED = 6.69437999014e-3;
const RADIANS = Math.PI / 180;

/** Metres per radian of latitude and of longitude at the origin, as `swarm.model.frames` has them. */
function scales(origin) {
  const sine = Math.sin(origin[0] * RADIANS);
  const squared = 1 - ECCENTRICITY_SQUARED * sine * sine;
  const primeVertical = SEMI_MAJOR_M / Math.sqrt(squared);
  const meridian = (SEMI_MAJOR_M * (1 - ECCENTRICITY_SQUARED)) / squared ** 1.5;
  return [meridian, primeVertical * Math.cos(origin[0] * RADIANS)];
}

/** Latitude and longitude [deg] of east and north [m]. */
export function degreesOf(origin, [east, north]) {
  const [meridian, parallel] = scales(origin);
  return [origin[0] + north / meridian / RADIANS, origin[1] + east / parallel / RADIANS];
}

/** East and north [m] of latitude and longitude [deg]. */
export function metresOf(origin, [lat, lon]) {
  const [meridian, parallel] = scales(origin);
  const turn = ((((lon - origin[1] + 180) % 360) + 360) % 360) - 180;
  return [turn * RADIANS * parallel, (lat - origin[0]) * RADIANS * meridian];
}

/** The mission's own plane: Leaflet's latitude is north, its longitude east, both in metres. */
export const PLANE = {
  name: "metres",
  crs: () => window.L.CRS.Simple,
  zooms: [-8, 9],
  toLeaflet: ([east, north]) => [north, east],
  fromLeaflet: ({ lat, lng }) => [lng, lat],
  unit: ([east, north]) => [east, -north],
};

/** The earth, about the mission's origin, as tiles show it. */
export function earth(origin) {
  return {
    name: "earth",
    crs: () => window.L.CRS.EPSG3857,
    zooms: [2, 23],
    toLeaflet: (position) => degreesOf(origin, position),
    fromLeaflet: ({ lat, lng }) => metresOf(origin, [lat, lng]),
    unit: (position) => {
      const [lat, lon] = degreesOf(origin, position);
      const mercator = Math.log(Math.tan(Math.PI / 4 + (lat * RADIANS) / 2));
      return [256 * (0.5 + lon / 360), 256 * (0.5 - mercator / (2 * Math.PI))];
    },
  };
}
