/** Clock positions: the angle θ from twelve o'clock, half a degree per minute. */

export function clockOf(thetaDeg: number, twelveAtDeg: number): string {
  const degrees = (((thetaDeg - twelveAtDeg) % 360) + 360) % 360;
  const minutes = Math.round(degrees * 2) % 720;
  const hours = Math.floor(minutes / 60) || 12;
  return `${hours}:${String(minutes % 60).padStart(2, "0")}`;
}

/** Parses a clock position; θ in degrees, or null if it is invalid. */
export function thetaOf(clock: string, twelveAtDeg: number): number | null {
  const parts = /^(\d{1,2})(?::(\d{2}))?$/.exec(clock.trim());
  if (!parts) return null;
  const [hours, minutes] = [Number(parts[1]), Number(parts[2] ?? 0)];
  if (hours > 12 || minutes > 59) return null;
  return (((hours % 12) * 30 + minutes / 2 + twelveAtDeg) % 360 + 360) % 360;
}

/** Parses a position in the page's address: `#h=12.3&clock=4:30`. */
export function placeOf(hash: string): { h: number; clock: string } | null {
  const values = new URLSearchParams(hash.replace(/^#/, ""));
  const h = Number.parseFloat(values.get("h") ?? "");
  return Number.isFinite(h) ? { h, clock: values.get("clock") ?? "12:00" } : null;
}
