//! What can be written on the command line.

use clap::{Args, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;

/// Six-degree-of-freedom haptic rendering: hold a rigid object and feel it touch a scene.
#[derive(Debug, Parser)]
#[command(name = "hapteron", version, max_term_width = 100)]
pub struct Arguments {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Show it working: the upper jaw in a simulated hand chews on the lower one, and a report
    #[command(after_help = "Example:\n  hapteron demo --out my-demo\n")]
    Demo(Demo),
    /// Run a scene and write run.csv, scene.toml and report.html
    #[command(after_help = RUN_EXAMPLES)]
    Run(Run),
    /// The paper's experiments in virtual time: paper, measured, holds
    #[command(after_help = "Examples:\n  hapteron reproduce\n  hapteron reproduce fig2 fig6 --out figures\n")]
    Reproduce(Reproduce),
    /// Contacts between two meshes at given poses of the first
    #[command(after_help = QUERY_EXAMPLES)]
    Query(Query),
    /// Check and describe a mesh
    #[command(
        after_help = "Examples:\n  hapteron mesh part.stl\n  hapteron mesh part.stl --scale 0.001 --build --out levels\n"
    )]
    Mesh(Mesh),
    /// Two runs side by side: a table and a report
    #[command(after_help = "Example:\n  hapteron compare runs/a runs/b\n")]
    Compare(Compare),
    /// Write the built-in meshes and scenes into a folder, to start one's own from
    #[command(
        after_help = "Example:\n  hapteron models my-models\n  hapteron run my-models/spoon_in_cup.toml --virtual-time\n"
    )]
    Models(Models),
}

const RUN_EXAMPLES: &str = "Examples:
  hapteron run scene.toml --virtual-time
  hapteron run scene.toml --virtual-time --replay hand.csv --out result
  hapteron run scene.toml --virtual-time --set coupling.linear_stiffness=500 --set integrator.method=runge-kutta-4
";

const QUERY_EXAMPLES: &str = "Examples:
  hapteron query body.obj obstacle.obj --poses poses.csv --tolerance 0.001
  hapteron query body.stl obstacle.stl --poses poses.csv --tolerance 0.0002 --contacts contacts.csv --rate
  hapteron query body.stl obstacle.stl --poses poses.csv --tolerance 0.0002 --error-threshold 0.025 --rate
";

/// `hapteron demo`
#[derive(Args, Debug)]
pub struct Demo {
    /// Folder for the results [default: runs/demo, numbered when it exists]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// `hapteron run`
#[derive(Args, Debug)]
pub struct Run {
    /// The scene (TOML)
    #[arg(value_name = "SCENE.toml")]
    pub scene: PathBuf,
    /// Run on the deterministic schedule, as fast as the machine can (the only way until real devices are supported)
    #[arg(long)]
    pub virtual_time: bool,
    /// Let the handle follow this motion exactly (t,px,py,pz,qw,qx,qy,qz) instead of the scene's hand
    #[arg(long, value_name = "T.csv")]
    pub replay: Option<PathBuf>,
    /// Override a key of the scene, as in contact.stiffness=2000; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub overrides: Vec<String>,
    /// Folder for the results [default: runs/NAME, numbered when it exists]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// `hapteron query`
#[derive(Args, Debug)]
pub struct Query {
    /// The mesh that moves (OBJ, STL, PLY or OFF)
    #[arg(value_name = "A")]
    pub body: PathBuf,
    /// The mesh that stays
    #[arg(value_name = "B")]
    pub obstacle: PathBuf,
    /// Poses of A's mesh frame in B's (CSV: t,px,py,pz,qw,qx,qy,qz; metres, unit quaternion)
    #[arg(long, value_name = "P.csv")]
    pub poses: PathBuf,
    /// Surfaces closer than this are in contact, metres
    #[arg(long, value_name = "D")]
    pub tolerance: f64,
    /// Write every contact into this file (CSV; world frame)
    #[arg(long, value_name = "C.csv")]
    pub contacts: Option<PathBuf>,
    /// Metres per unit of both meshes
    #[arg(long, default_value_t = 1.0, value_name = "S")]
    pub scale: f64,
    /// Contacts may be as coarse as this share of A's radius, such as 0.025; each then has a weight, the number of vertices
    /// that it stands for. 0 is exact
    #[arg(long, default_value_t = 0.0, value_name = "S")]
    pub error_threshold: f64,
    /// Tell on stderr how long the queries took
    #[arg(long)]
    pub rate: bool,
}

/// `hapteron mesh`
#[derive(Args, Debug)]
pub struct Mesh {
    /// The mesh (OBJ, STL, PLY or OFF), or builtin:NAME
    #[arg(value_name = "FILE")]
    pub file: String,
    /// Metres per unit of the mesh
    #[arg(long, default_value_t = 1.0, value_name = "S")]
    pub scale: f64,
    /// Make and cache the contact levels of detail, print them, and draw them in a report
    #[arg(long)]
    pub build: bool,
    /// With --build: folder for the report [default: runs/mesh, numbered when it exists]
    #[arg(long, value_name = "DIR", requires = "build")]
    pub out: Option<PathBuf>,
    /// With --build: folder of the cache [default: hapteron in the user's cache folder]
    #[arg(long, value_name = "DIR", requires = "build")]
    pub cache: Option<PathBuf>,
}

/// `hapteron compare`
#[derive(Args, Debug)]
pub struct Compare {
    /// A run.csv, or the folder with it
    #[arg(value_name = "A")]
    pub first: PathBuf,
    /// The run to be compared with the first
    #[arg(value_name = "B")]
    pub second: PathBuf,
    /// Folder for the report [default: runs/compare, numbered when it exists]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// `hapteron models`
#[derive(Args, Debug)]
pub struct Models {
    /// The folder, made when it does not exist
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
}

/// `hapteron reproduce`
#[derive(Args, Debug)]
pub struct Reproduce {
    /// Which figures of the paper [default: all]
    #[arg(value_enum, value_name = "FIGURE")]
    pub figures: Vec<Figure>,
    /// Folder for the results [default: runs/reproduce, numbered when it exists]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// An experiment of the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Figure {
    /// The spoon in free space: integrators and masses
    Fig2,
    /// The spoon in the cup: contact
    Fig4,
    /// The jaws: the linearized contact model and slow contact threads
    Fig6,
}
