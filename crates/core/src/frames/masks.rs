//! The masks of a survey's frames.

use super::mask::Mask;
use std::sync::Arc;

/// The masks of a survey's frames, as [`tunnelstitch_geometry::camera::Cameras`] are their cameras:
/// frame k has the mask of camera k modulo their number.
#[derive(Clone, Debug, Default)]
pub struct Masks {
    /// One per camera; empty without any mask.
    of_cameras: Vec<Option<Arc<Mask>>>,
}

impl Masks {
    /// No masks.
    pub const NONE: Self = Self {
        of_cameras: Vec::new(),
    };

    /// The masks of the cameras of a rig.
    pub fn of_rig(masks: Vec<Option<Mask>>) -> Self {
        Self {
            of_cameras: masks.into_iter().map(|mask| mask.map(Arc::new)).collect(),
        }
    }

    /// The mask of a frame, if it has one.
    pub fn of(&self, frame: usize) -> Option<&Arc<Mask>> {
        let cameras = self.of_cameras.len();
        self.of_cameras.get(frame.checked_rem(cameras)?)?.as_ref()
    }

    /// The share of the pictures that the masks hide, 0 to 1: the mean over the cameras.
    pub fn masked_fraction(&self) -> f64 {
        let cameras = self.of_cameras.len().max(1);
        let hidden = self.of_cameras.iter().flatten();
        hidden.map(|mask| mask.masked_fraction()).sum::<f64>() / cameras as f64
    }

    /// Also hides the pixels of `mask` in all frames.
    pub fn hide(&mut self, mask: &Mask) {
        if self.of_cameras.is_empty() {
            self.of_cameras.push(None);
        }
        for own in &mut self.of_cameras {
            let united = match own.as_ref() {
                Some(own) => own.union(mask),
                None => mask.clone(),
            };
            *own = Some(Arc::new(united));
        }
    }

    /// The masks of some of the frames, which are numbered anew.
    #[must_use]
    pub fn of_frames(&self, frames: &[usize]) -> Self {
        if self.of_cameras.len() <= 1 {
            return self.clone();
        }
        Self {
            of_cameras: frames.iter().map(|k| self.of(*k).cloned()).collect(),
        }
    }
}

impl From<Option<Mask>> for Masks {
    fn from(mask: Option<Mask>) -> Self {
        Self::of_rig(vec![mask])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_have_the_masks_of_their_cameras() {
        let left = Mask::new(2, 1, &[false, true]);
        let mut masks = Masks::of_rig(vec![Some(left.clone()), None]);
        assert_eq!(**masks.of(4).unwrap(), left);
        assert!(masks.of(3).is_none() && Masks::NONE.of(3).is_none());
        assert_eq!(masks.masked_fraction(), 0.25);
        let chosen = masks.of_frames(&[1, 2]);
        assert!(chosen.of(0).is_none() && chosen.of(1).is_some());
        let right = Mask::new(2, 1, &[true, false]);
        masks.hide(&right);
        assert_eq!(**masks.of(0).unwrap(), left.union(&right));
        assert_eq!(**masks.of(1).unwrap(), right);
    }
}
