//! Line charts as inline SVG, coloured by the style sheet of the page.
//!
//! A [`Chart`] is drawn over a [`plot_scale`], which maps its values to the drawing; a [`legend()`]
//! explains the curves of several charts.

mod draw;
mod legend;
mod model;
mod plot_scale;

pub use legend::{ChartElement, legend};
pub use model::{Axis, Chart, CurveStyle, Series, Vertical};
