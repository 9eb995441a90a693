//! Photometric calibration: gains and biases of the frames and the shading that all share, from
//! what overlapping frames show of the same wall points.
//!
//! # The equation
//!
//! Frame i shows the wall point x at pixel `u_i(x)` with the grey value
//!
//! `I_i(x) = a_i V(u_i(x)) S(x) + b_i + noise`.
//!
//! Part of it may be known: a factor `f ≈ a_i V` and a bias. Taking both off leaves the value
//! `z = (I − bias)/f`, in the units of the wall. With α what is missing from the frame's
//! logarithmic gain, β from its bias, and `exp(Σ c_k B_k)` from the shading,
//!
//! `z_i(x) = m_i(x) + β_i/f_i(x) + noise`,   `m_i(x) = S(x) exp(α_i + Σ_k c_k B_k(u_i(x)))`,
//!
//! and with `s = ln S`
//!
//! `ln(z_i(x) − β_i/f_i(x)) = s(x) + α_i + Σ_k c_k B_k(u_i(x)) + noise`.
//!
//! Linearised at the solution so far, and to first order in the bias itself, it is
//!
//! `ln z_i(x) = s(x) + α_i + β_i/(f_i m_i) + Σ_k c_k B_k(u_i(x)) + noise`.
//!
//! A lamp that moves with the camera adds the changes of its position times the derivatives of its
//! light there ([`tunnelstitch_core::frames::Lamp::log_falloff`]), as further terms `c_k B_k`.
//!
//! The regressor of β must be the model value `1/(f_i m_i)` by the solution so far. With the
//! measured z in place of m the same noise would be on both sides of the equation (errors in
//! variables) and look like a bias: for noise of relative size ε, on a wall whose logarithm varies
//! by τ, β is wrong by about `−ε²/(τ² + ε²)` of the grey value, and behind a known shading V this
//! wrong `β/(a V S)` passes for a change of V.
//!
//! The model value contains s, which is estimated from the same observations. The noise of `ln z_i`
//! is `n_i/(f_i m_i)`, n being equal in all frames as grey levels of the frame. In the mean with
//! weights of the inverse variance, `w_i = (f_i m_i)²`, it becomes
//! `n_s = Σ w_i n_i/(f_i m_i) / Σ w_i`, and `Cov(n_s, n_i/(f_i m_i)) = σ²/Σ w` is the same for all
//! i. It cancels in the difference of any two observations, which is all that is left once s is
//! eliminated. Equal weights would leave a part of the error above where frames see the point in
//! different light.
//!
//! # The solution
//!
//! Robust least squares with these weights times Tukey's biweight, over wall points spread over all
//! frames. At every point s is eliminated: rows and logarithms are taken relative to their weighted
//! mean there. What remains couples a frame to those that overlap it and all of them to the
//! shading, a sparse bordered system that is solved by a sparse Cholesky factorisation. All frames
//! are solved for at once, so nothing drifts from neighbour to neighbour. Linearising and
//! reweighting are repeated until the variance of the residuals has settled.
//!
//! A common factor of all gains and the wall cannot be observed; the prior of the gains leaves it
//! near 1.
//!
//! | symbol | in code | meaning | unit |
//! | --- | --- | --- | --- |
//! | z | `value` | value of a wall point by one frame | grey levels of the wall |
//! | f | `factor` | known part of `a V` | 1 |
//! | m | `model` | z without bias and noise by the solution so far | grey levels of the wall |
//! | α | `log_gains` | logarithm of the gain | 1 |
//! | β | `biases` | bias | grey levels of the frame |
//! | c_k, B_k | `shading`, `lamp`, `terms` | coefficients and terms of the logarithmic light | 1 |
//!
//! | part | file |
//! | --- | --- |
//! | observations and their rows of the equation | [`observation`] |
//! | residuals and weights of the readings of one point | [`robust_weights`] |
//! | sparse normal equations, s eliminated | [`normal_equations`] |
//! | priors of the unknowns | [`priors`] |
//! | reweighting, result and its significance | [`calibration`] |
//! | light that moves with the camera, and the evidence for a lamp | [`light_model`] |
//!
//! Source: D. J. Fixsen, S. H. Moseley and R. G. Arendt, "Calibrating array detectors",
//! Astrophysical Journal Supplement 128, 2000 (flat fields from pictures that show the same sky in
//! different places); for panoramas D. B. Goldman, "Vignette and exposure calibration and
//! compensation", PAMI 32(12), 2010; on errors in variables W. A. Fuller, "Measurement Error
//! Models", Wiley 1987, §1.1.

mod calibration;
mod light_model;
mod normal_equations;
mod observation;
mod priors;
mod robust_weights;

pub use calibration::PhotometricCalibration;
pub use light_model::{LightModel, MAX_LIGHT_FRAMES, ObservedPoint, light_frames};
pub use observation::Observation;
pub use priors::Priors;
