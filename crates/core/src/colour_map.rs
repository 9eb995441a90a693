//! Colour maps for values over the wall.

/// Eight nodes of the colour map cividis, which is uniform for colour-blind readers, too.
///
/// Source: J. R. Nuñez, C. R. Anderton, R. S. Renslow, "Optimizing colormaps with consideration for
/// color vision deficiency", PLOS ONE 13(7), 2018.
const CIVIDIS: [[u8; 3]; 8] = [
    [0, 34, 78],
    [39, 61, 109],
    [79, 87, 108],
    [109, 114, 116],
    [139, 137, 121],
    [175, 164, 112],
    [213, 193, 94],
    [254, 232, 56],
];

/// Nine nodes of the colour map RdBu, reversed: blue for negative values, red for positive ones.
///
/// Source: M. Harrower, C. A. Brewer, "ColorBrewer.org: an online tool for selecting colour schemes
/// for maps", The Cartographic Journal 40(1), 2003.
const BLUE_RED: [[u8; 3]; 9] = [
    [33, 102, 172],
    [67, 147, 195],
    [146, 197, 222],
    [209, 229, 240],
    [247, 247, 247],
    [253, 219, 199],
    [244, 165, 130],
    [214, 96, 77],
    [178, 24, 43],
];

/// A colour map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Palette {
    /// From dark to bright, for amounts.
    Cividis,
    /// From blue by white to red, for values of either sign.
    BlueRed,
}

impl Palette {
    fn nodes(self) -> &'static [[u8; 3]] {
        match self {
            Self::Cividis => &CIVIDIS,
            Self::BlueRed => &BLUE_RED,
        }
    }

    /// Colour at a position on the scale, 0–1.
    pub fn colour(self, share: f64) -> [u8; 3] {
        let nodes = self.nodes();
        let position = share.clamp(0.0, 1.0) * (nodes.len() - 1) as f64;
        let below = (position.floor() as usize).min(nodes.len() - 2);
        let part = position - below as f64;
        let mix = |c: usize| {
            let (a, b) = (f64::from(nodes[below][c]), f64::from(nodes[below + 1][c]));
            (a + part * (b - a)).round() as u8
        };
        [mix(0), mix(1), mix(2)]
    }

    /// The scale as a CSS gradient, from left to right.
    pub fn gradient(self) -> String {
        let stops: Vec<String> = (self.nodes().iter())
            .map(|[red, green, blue]| format!("rgb({red} {green} {blue})"))
            .collect();
        format!("linear-gradient(to right, {})", stops.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_grow_brighter_along_the_scale() {
        let brightness = |share: f64| {
            let [red, green, blue] = Palette::Cividis.colour(share).map(f64::from);
            0.2126 * red + 0.7152 * green + 0.0722 * blue
        };
        let steps: Vec<f64> = (0..=50).map(|k| brightness(f64::from(k) / 50.0)).collect();
        assert!(steps.is_sorted(), "{steps:?}");
        let ends = [-1.0, 2.0].map(|share| Palette::Cividis.colour(share));
        assert_eq!(ends, [CIVIDIS[0], CIVIDIS[7]]);
        assert_eq!(Palette::BlueRed.colour(0.5), [247; 3]);
    }
}
