//! What can be plotted: names, units, curves.

use crate::theme::Palette;
use crate::view::Colour;
use hapteron::recording::Row;

/// Something that is plotted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Graph {
    /// On the hand and by the contacts.
    Force,
    /// On the hand and by the contacts.
    Torque,
    /// Stretch of the coupling.
    Deviation,
    /// Greatest local depth.
    Penetration,
    /// Contacts and planes.
    Contacts,
    /// Contact passes a second.
    Rate,
    /// Age of the contacts in use.
    Age,
    /// How late ticks start.
    Jitter,
}

/// A curve.
pub struct Series {
    /// Of several in one plot.
    pub name: &'static str,
    /// As in the 3D view.
    pub colour: fn(&Palette) -> Colour,
    /// In the graph's unit.
    pub value: fn(&Row) -> f64,
}

impl Graph {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::Force,
        Self::Torque,
        Self::Deviation,
        Self::Penetration,
        Self::Contacts,
        Self::Rate,
        Self::Age,
        Self::Jitter,
    ];

    /// What people call it, and its unit.
    pub fn title(self) -> (&'static str, &'static str) {
        match self {
            Self::Force => ("Force", "N"),
            Self::Torque => ("Torque", "mN m"),
            Self::Deviation => ("Coupling deviation", "mm"),
            Self::Penetration => ("Penetration", "mm"),
            Self::Contacts => ("Contacts", ""),
            Self::Rate => ("Contact rate", "Hz"),
            Self::Age => ("Contact age", "ms"),
            Self::Jitter => ("Tick jitter", "µs late"),
        }
    }

    /// What a mouse that rests on its name is told.
    pub fn hint(self) -> &'static str {
        match self {
            Self::Force => {
                "hand: the force that the device is told. contact: the sum of the contact forces on the body."
            }
            Self::Torque => "hand: about the handle. contact: about the body's centre of mass.",
            Self::Deviation => "How far the handle is from the point of the body that it holds.",
            Self::Penetration => {
                "The greatest local depth that the contact passes found; below zero the surfaces do not cross, down to the contact tolerance."
            }
            Self::Contacts => "found: contacts of the last query. planes: what they were made to.",
            Self::Rate => "Contact passes a second.",
            Self::Age => "How long ago the body was where the contacts in use were found.",
            Self::Jitter => {
                "How many ticks started how long after their deadline, since the start. Both axes logarithmic."
            }
        }
    }

    /// Its curves; none where it is no curve over the ticks.
    pub fn series(self) -> &'static [Series] {
        match self {
            Self::Force => &[
                Series { name: "contact", colour: |p| p.contact, value: |r| r.contact[0].norm() },
                Series { name: "hand", colour: |p| p.force, value: |r| r.feedback[0].norm() },
            ],
            Self::Torque => &[
                Series { name: "contact", colour: |p| p.contact, value: |r| r.contact[1].norm() * 1e3 },
                Series { name: "hand", colour: |p| p.torque, value: |r| r.feedback[1].norm() * 1e3 },
            ],
            Self::Deviation => &[Series { name: "", colour: |p| p.coupling, value: |r| r.deviation * 1e3 }],
            Self::Penetration => {
                &[Series { name: "", colour: |p| p.touching, value: |r| r.penetration * 1e3 }]
            }
            Self::Contacts => &[
                Series { name: "found", colour: |p| p.near, value: |r| f64::from(r.contacts) },
                Series { name: "planes", colour: |p| p.plane, value: |r| f64::from(r.clusters) },
            ],
            Self::Age => &[Series { name: "", colour: |p| p.body, value: |r| r.contact_age * 1e3 }],
            Self::Rate | Self::Jitter => &[],
        }
    }

    /// The plot never shows less than this, so that noise does not fill it.
    pub fn least_span(self) -> f64 {
        match self {
            Self::Force => 0.5,
            Self::Torque => 5.0,
            Self::Deviation | Self::Age => 1.0,
            Self::Penetration => 0.2,
            Self::Contacts => 10.0,
            Self::Rate => 100.0,
            Self::Jitter => 1.0,
        }
    }
}
