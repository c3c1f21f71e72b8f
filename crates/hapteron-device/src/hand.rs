//! A hand that holds the handle: how heavily, how stiffly, and how it trembles.

use nalgebra::Vector3;

/// The hand's impedance, for translation and (with the mass at [`GRIP_RADIUS`]) for rotation. All zero: nobody holds the handle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HandParameters {
    /// Of the hand as far as it moves with the handle, kg.
    pub mass: f64,
    /// N s/m.
    pub damping: f64,
    /// Towards where the hand wants to be, N/m.
    pub stiffness: f64,
}

/// Radius of gyration by which translation's mass, damping and stiffness become those of rotation, metres. With a light
/// pinch (0.05 kg, 4 N s/m, 100 N/m) it gives moments as measured at a pinch: 2e-5 kg m^2, 1.6e-3 N m s, 0.04 N m.
pub const GRIP_RADIUS: f64 = 0.02;

/// How firmly a person holds the handle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Grip {
    /// Not at all.
    Released,
    /// With the fingertips.
    Light,
    /// As one holds a pen to write.
    Medium,
    /// As one holds a hammer.
    Firm,
}

impl Grip {
    /// From released to firm.
    pub const ALL: [Self; 4] = [Self::Released, Self::Light, Self::Medium, Self::Firm];

    /// Impedances of the closed-loop experiments (kg, N s/m, N/m).
    #[must_use]
    pub fn parameters(self) -> HandParameters {
        let (mass, damping, stiffness) = match self {
            Self::Released => (0.0, 0.0, 0.0),
            Self::Light => (0.1, 2.0, 50.0),
            Self::Medium => (0.3, 3.5, 200.0),
            Self::Firm => (0.5, 5.0, 500.0),
        };
        HandParameters { mass, damping, stiffness }
    }
}

/// Why a hand cannot be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandError(pub &'static str, pub f64);

impl std::fmt::Display for HandError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "hand.{} is {}; it must be finite and not negative", self.0, self.1)
    }
}

impl std::error::Error for HandError {}

impl HandParameters {
    /// Each value in its range.
    ///
    /// # Errors
    /// Mass, damping and stiffness must be finite and not negative.
    pub fn check(&self) -> Result<(), HandError> {
        let values = [("mass", self.mass), ("damping", self.damping), ("stiffness", self.stiffness)];
        match values.into_iter().find(|(_, v)| !(*v >= 0.0 && v.is_finite())) {
            Some((name, value)) => Err(HandError(name, value)),
            None => Ok(()),
        }
    }
}

/// Sines that tremor is made of, for each axis.
const SINES: usize = 3;
/// Physiological tremor, Hz.
const LOWEST: f64 = 8.0;
const HIGHEST: f64 = 12.0;

/// The tremor of a hand: for each axis a few sines of 8 to 12 Hz, by a seed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tremor {
    /// Frequency (rad/s) and phase; three axes of translation, three of rotation.
    sines: [[(f64, f64); SINES]; 6],
    /// Of each sine, metres.
    amplitude: f64,
}

impl Tremor {
    /// Tremor whose root mean square on each axis is that of one sine of this amplitude (metres).
    #[must_use]
    pub fn new(amplitude: f64, seed: u64) -> Self {
        let mut random = super::simulated::Random::new(seed);
        let mut sine = || {
            let frequency = LOWEST + (HIGHEST - LOWEST) * random.unit();
            (std::f64::consts::TAU * frequency, std::f64::consts::TAU * random.unit())
        };
        let sines = std::array::from_fn(|_| std::array::from_fn(|_| sine()));
        Self { sines, amplitude: amplitude / (SINES as f64).sqrt() }
    }

    /// How far the hand is off where it wants to be: translation (metres) and turn (radians).
    #[must_use]
    pub fn at(&self, time: f64) -> [Vector3<f64>; 2] {
        if self.amplitude == 0.0 {
            return [Vector3::zeros(); 2];
        }
        let sum = |axis: usize| -> f64 {
            self.sines[axis].iter().map(|(w, p)| libm::sin(w * time + p)).sum::<f64>() * self.amplitude
        };
        let turn = Vector3::new(sum(3), sum(4), sum(5)) / GRIP_RADIUS;
        [Vector3::new(sum(0), sum(1), sum(2)), turn]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn impedance_must_be_physical() {
        for grip in Grip::ALL {
            assert!(grip.parameters().check().is_ok());
        }
        let good = Grip::Light.parameters();
        for bad in [-1.0, f64::NAN, f64::INFINITY] {
            assert!(HandParameters { mass: bad, ..good }.check().is_err());
            assert!(HandParameters { damping: bad, ..good }.check().is_err());
            assert!(HandParameters { stiffness: bad, ..good }.check().is_err());
        }
    }

    /// Would catch tremor of another size or frequency than it says, or one that the seed does not determine.
    #[test]
    fn tremor_has_its_size_and_frequency() {
        let tremor = Tremor::new(1e-4, 7);
        let (mut squares, mut crossings) = (0.0, 0);
        let ticks = 60_000;
        let mut before = 0.0;
        for i in 0..ticks {
            let [x, turn] = tremor.at(f64::from(i) * 1e-3);
            squares += x.y * x.y;
            crossings += u32::from(x.y * before < 0.0);
            before = x.y;
            assert!(turn.norm() < 3.0 * 1e-4 * 3f64.sqrt() / GRIP_RADIUS);
        }
        let rms = (squares / f64::from(ticks)).sqrt();
        assert!((rms - 1e-4 / 2f64.sqrt()).abs() < 0.05e-4, "{rms}");
        let frequency = f64::from(crossings) / 2.0 / 60.0;
        assert!(frequency > 8.0 && frequency < 12.0, "{frequency} Hz");
        assert_eq!(tremor, Tremor::new(1e-4, 7));
        assert_ne!(tremor, Tremor::new(1e-4, 8));
    }
}
