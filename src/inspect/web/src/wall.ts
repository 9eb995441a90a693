/**
 * Geometry of the wall by interpolation of its points: conversion of (s, h) to the world, distances
 * to the wall and lengths on it. The shape of the tunnel is not needed.
 */
import { Vector3 } from "three";
import type { Tunnel, WallPoints } from "./tunnel";

export interface WallPlace {
  s: number;
  h: number;
}

/** Cross-section of the tunnel at a chainage, with its local axes. */
export interface Station {
  h: number;
  centre: Vector3;
  /** Orthonormal axes: along the tunnel, towards twelve o'clock, and to the right. */
  along: Vector3;
  up: Vector3;
  right: Vector3;
}

/** Number of segments by which the length of a line is summed. */
const LENGTH_SEGMENTS = 256;
/** Maximum iterations to find the section of a point. */
const MAX_STATION_ITERATIONS = 20;

export class Wall {
  readonly perimeter: number;
  readonly chainage: [number, number];
  /** Mean distance of the wall from the centre of the first section. */
  readonly radius: number;
  private readonly s: number[];
  private readonly h: number[];
  private readonly points: number[];
  private readonly centres: Vector3[] = [];
  private readonly angles: number[];
  private readonly twelve: number;
  private readonly twelveAtDeg: number;

  constructor(tunnel: Tunnel, points: WallPoints) {
    this.perimeter = tunnel.perimeter_m;
    this.chainage = [points.h_m[0], points.h_m[points.h_m.length - 1]];
    this.s = points.s_m;
    this.h = points.h_m;
    this.points = points.points_m;
    this.angles = tunnel.theta_deg;
    this.twelveAtDeg = tunnel.twelve_at_deg;
    this.twelve = this.sAtHour(12);
    for (let row = 0; row < this.h.length; row++) {
      const centre = new Vector3();
      for (let column = 1; column < this.s.length; column++) {
        const share = (this.s[column] - this.s[column - 1]) / this.perimeter / 2;
        centre.addScaledVector(this.corner(column, row), share);
        centre.addScaledVector(this.corner(column - 1, row), share);
      }
      this.centres.push(centre);
    }
    this.radius = this.centres[0].distanceTo(this.corner(0, 0));
  }

  /** World point of a wall position; s is periodic, h is extrapolated beyond the ends. */
  point({ s, h }: WallPlace): Vector3 {
    const [column, across] = this.cell(this.s, this.around(s));
    const [row, down] = this.cell(this.h, h);
    const upper = this.corner(column, row).lerp(this.corner(column + 1, row), across);
    const lower = this.corner(column, row + 1).lerp(this.corner(column + 1, row + 1), across);
    return upper.lerp(lower, down);
  }

  /** The axis and its directions at a chainage. */
  station(h: number): Station {
    const [row, share] = this.cell(this.h, h);
    const [from, to] = [this.centres[row], this.centres[row + 1]];
    const centre = from.clone().lerp(to, share);
    const along = this.tangent(row).lerp(this.tangent(row + 1), Math.min(Math.max(share, 0), 1)).normalize();
    const up = this.point({ s: this.twelve, h }).sub(centre);
    up.addScaledVector(along, -up.dot(along)).normalize();
    return { h, centre, along, up, right: along.clone().cross(up) };
  }

  /** The station whose section a point lies in. */
  stationOf(x: Vector3): Station {
    let [best, h] = [Infinity, this.h[0]];
    const last = this.h.length - 2;
    for (let row = 0; row <= last; row++) {
      const [from, to] = [this.centres[row], this.centres[row + 1]];
      const axis = to.clone().sub(from);
      const share = x.clone().sub(from).dot(axis) / axis.lengthSq();
      const within = Math.min(Math.max(share, row === 0 ? -Infinity : 0), row === last ? Infinity : 1);
      const distance = from.clone().addScaledVector(axis, within).distanceToSquared(x);
      if (distance < best) [best, h] = [distance, this.h[row] + within * (this.h[row + 1] - this.h[row])];
    }
    // Iterate, since the direction of the axis changes between the lines.
    let station = this.station(h);
    for (let round = 0; round < MAX_STATION_ITERATIONS; round++) {
      const ahead = x.clone().sub(station.centre).dot(station.along);
      if (Math.abs(ahead) < this.radius * 1e-6) break;
      station = this.station(station.h + ahead);
    }
    return station;
  }

  /** Intersects a ray from the centre of a section with the wall: position and distance. */
  towards(station: Station, direction: Vector3): { place: WallPlace; distance: number } {
    const [x, y] = [direction.dot(station.right), direction.dot(station.up)];
    const flat = (column: number): [number, number] => {
      const point = this.point({ s: this.s[column], h: station.h }).sub(station.centre);
      return [point.dot(station.right), point.dot(station.up)];
    };
    let found = { place: { s: this.twelve, h: station.h }, distance: this.radius };
    let from = flat(0);
    for (let column = 1; column < this.s.length; column++) {
      const last = column === this.s.length - 1;
      const to = last ? flat(0) : flat(column);
      // from + λ (to − from) = μ (x, y)
      const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
      const determinant = dx * y - dy * x;
      const share = (from[1] * x - from[0] * y) / determinant;
      if (determinant !== 0 && share >= 0 && share < 1) {
        const [px, py] = [from[0] + share * dx, from[1] + share * dy];
        if (px * x + py * y > 0) {
          const s = this.s[column - 1] + share * (this.s[column] - this.s[column - 1]);
          found = { place: { s, h: station.h }, distance: Math.hypot(px, py) };
        }
      }
      from = to;
    }
    return found;
  }

  /** Clamps a point towards the centre to keep a distance from the wall and the ends. */
  inside(x: Vector3, margin: number): Vector3 {
    const beyond = this.radius * 0.5;
    let station = this.stationOf(x);
    const h = Math.min(Math.max(station.h, this.chainage[0] - beyond), this.chainage[1] + beyond);
    const offset = x.clone().sub(station.centre);
    if (h !== station.h) station = this.station(h);
    offset.addScaledVector(station.along, -offset.dot(station.along));
    const length = offset.length();
    if (length > 0) {
      const room = Math.max(this.towards(station, offset).distance - margin, 0);
      if (length > room) offset.multiplyScalar(room / length);
    }
    return station.centre.clone().add(offset);
  }

  /** Shifts `to` by whole turns so that the line from `from` takes the shorter way around. */
  nearest(from: WallPlace, to: WallPlace): WallPlace {
    const turns = Math.round((to.s - from.s) / this.perimeter);
    return { s: to.s - turns * this.perimeter, h: to.h };
  }

  /** Length on the wall of a line that is straight on the unrolled wall, metres. */
  length(from: WallPlace, to: WallPlace): number {
    const end = this.nearest(from, to);
    let [sum, last] = [0, this.point(from)];
    for (let k = 1; k <= LENGTH_SEGMENTS; k++) {
      const share = k / LENGTH_SEGMENTS;
      const next = this.point({ s: from.s + share * (end.s - from.s), h: from.h + share * (end.h - from.h) });
      sum += last.distanceTo(next);
      last = next;
    }
    return sum;
  }

  around(s: number): number {
    return ((s % this.perimeter) + this.perimeter) % this.perimeter;
  }

  /** Angle θ of an arc length, degrees. */
  thetaDeg(s: number): number {
    const steps = this.angles.length - 1;
    const at = (this.around(s) / this.perimeter) * steps;
    const before = Math.min(Math.floor(at), steps - 1);
    const [from, to] = [this.angles[before], this.angles[before + 1]];
    return (from + (at - before) * (to - from)) % 360;
  }

  /** Arc length at an angle θ, metres. */
  sAt(thetaDeg: number): number {
    const steps = this.angles.length - 1;
    const theta = this.angles[0] + ((((thetaDeg - this.angles[0]) % 360) + 360) % 360);
    let after = this.angles.findIndex((angle) => angle > theta);
    if (after < 1) after = steps;
    const [from, to] = [this.angles[after - 1], this.angles[after]];
    const share = to > from ? (theta - from) / (to - from) : 0;
    return ((after - 1 + Math.min(share, 1)) / steps) * this.perimeter;
  }

  /** Arc length at a clock hour, metres. */
  sAtHour(hour: number): number {
    return this.sAt(this.twelveAtDeg + 30 * hour);
  }

  private corner(column: number, row: number): Vector3 {
    return new Vector3().fromArray(this.points, 3 * (row * this.s.length + column));
  }

  private tangent(row: number): Vector3 {
    const [before, after] = [Math.max(row - 1, 0), Math.min(row + 1, this.centres.length - 1)];
    return this.centres[after].clone().sub(this.centres[before]).normalize();
  }

  /** Cell of a value among increasing lines, and the relative position in it. */
  private cell(lines: number[], value: number): [number, number] {
    let [low, high] = [0, lines.length - 1];
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (lines[middle] <= value) low = middle;
      else high = middle;
    }
    return [low, (value - lines[low]) / (lines[low + 1] - lines[low])];
  }
}
