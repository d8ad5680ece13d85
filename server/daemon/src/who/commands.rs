//! `palpated pki`: keys for a daemon on a network, and who may do what with them.
use super::{
    Identity,
    folder::{Folder, FolderError},
    is_name,
    role::{Role, Roles},
    token,
};
use clap::{Args, Subcommand};
use miette::{IntoDiagnostic as _, miette};
use std::{
    io::Write as _,
    path::PathBuf,
    process::ExitCode,
    time::{Duration, SystemTime},
};

const HOUR: Duration = Duration::from_hours(1);

/// Keys and identities for a daemon that others reach by a network.
#[derive(Debug, Clone, Args)]
pub struct PkiArgs {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Clone, Args)]
struct Place {
    /// The folder of keys; `palpated serve --pki` takes the same
    #[arg(long, value_name = "FOLDER", default_value = "palpate-pki")]
    folder: PathBuf,
}

#[derive(Debug, Clone, Subcommand)]
enum Command {
    /// Make an authority, the daemon's certificate and the key of tokens
    ///
    /// What is there already stays, but for the daemon's certificate, which is made anew for the hosts that are named.
    Init {
        #[command(flatten)]
        place: Place,
        /// A name or address under which others reach the daemon, beside localhost and this machine's name; may be given several times
        #[arg(long = "host", value_name = "NAME")]
        hosts: Vec<String>,
    },
    /// Issue a certificate and key to a person, a program or an arm
    Issue {
        #[command(flatten)]
        place: Place,
        /// Who: 1 to 64 letters, digits, - and _
        name: String,
        /// What for; may be given several times
        #[arg(long = "role", value_enum, required = true)]
        roles: Vec<Role>,
        /// For how long it is good
        #[arg(long, value_name = "DAYS", default_value_t = 365, value_parser = clap::value_parser!(u32).range(1..=3650))]
        days: u32,
        /// Where to write NAME.pem and NAME.key
        #[arg(long, value_name = "FOLDER", default_value = ".")]
        out: PathBuf,
    },
    /// Print a token for a script or a browser
    Token {
        #[command(flatten)]
        place: Place,
        /// Who: 1 to 64 letters, digits, - and _
        name: String,
        /// What for; may be given several times
        #[arg(long = "role", value_enum, required = true)]
        roles: Vec<Role>,
        /// For how long it is good
        #[arg(long, value_name = "HOURS", default_value_t = 12, value_parser = clap::value_parser!(u32).range(1..=87_600))]
        hours: u32,
    },
    /// Print a token made of another, for less: needs no key
    Narrow {
        /// The token, or - to read it from standard input
        token: String,
        /// What it is still for; may be given several times [default: all it was for]
        #[arg(long = "role", value_enum)]
        roles: Vec<Role>,
        /// For how long it is still good [default: as long as it was]
        #[arg(long, value_name = "HOURS", value_parser = clap::value_parser!(u32).range(1..=87_600))]
        hours: Option<u32>,
    },
    /// Take everything from a name; a daemon that runs reads it again on SIGHUP
    Revoke {
        #[command(flatten)]
        place: Place,
        /// Who
        name: String,
    },
}

/// Runs the command.
///
/// # Errors
/// A file, or a name or token that is none.
pub fn run(args: &PkiArgs) -> miette::Result<ExitCode> {
    let now = SystemTime::now();
    let said = match &args.command {
        Command::Init { place, hosts } => init(place, hosts, now)?,
        Command::Issue { place, name, roles, days, out } => {
            let (roles, lasts) = (Roles::of(roles), 24 * HOUR * *days);
            let (certificate, key) = Folder::at(&place.folder).issue(name, roles, lasts, now, out)?;
            let authority = Folder::at(&place.folder).authority();
            format!(
                "{} and {}: {name}, for {roles}, for {days} days\nWith {}, which is no secret, they are what a client is given: \
                 --tls-ca ca.pem --tls-cert {name}.pem --tls-key {name}.key",
                certificate.display(),
                key.display(),
                authority.display()
            )
        }
        Command::Token { place, name, roles, hours } => {
            if !is_name(name) {
                return Err(FolderError::Name { name: name.clone() }.into());
            }
            Folder::at(&place.folder).refuse_revoked(name)?;
            let key = Folder::at(&place.folder).token_key()?;
            token::mint(&key, &Identity { name: name.clone(), roles: Roles::of(roles), until: now + HOUR * *hours })
        }
        Command::Narrow { token, roles, hours } => narrow(token, roles, *hours, now)?,
        Command::Revoke { place, name } => {
            Folder::at(&place.folder).revoke(name)?;
            format!("{name} is revoked; `systemctl reload palpated`, or SIGHUP, tells a daemon that runs")
        }
    };
    // A reader that has gone misses it, no more.
    let _ = writeln!(std::io::stdout(), "{said}");
    Ok(ExitCode::SUCCESS)
}

fn init(place: &Place, hosts: &[String], now: SystemTime) -> miette::Result<String> {
    let own = rustix::system::uname().nodename().to_string_lossy().into_owned();
    let mut all = vec!["localhost".to_owned(), "127.0.0.1".to_owned(), "::1".to_owned(), own];
    all.extend(hosts.iter().filter(|host| !all.contains(host)).cloned().collect::<Vec<_>>());
    let folder = Folder::at(&place.folder);
    folder.init(&all, now)?;
    Ok(format!(
        "{0}: keys for a daemon known as {1}\nNext: palpated serve --pki {0} --listen 0.0.0.0:7411\n      palpated pki issue NAME --role \
         viewer --folder {0}",
        place.folder.display(),
        all.join(", ")
    ))
}

fn narrow(given: &str, roles: &[Role], hours: Option<u32>, now: SystemTime) -> miette::Result<String> {
    let text =
        if given == "-" { std::io::read_to_string(std::io::stdin()).into_diagnostic()? } else { given.to_owned() };
    let roles = (!roles.is_empty()).then(|| Roles::of(roles));
    let narrowed = token::narrow(text.trim(), roles, hours.map(|hours| now + HOUR * hours));
    let narrowed = narrowed.map_err(|error| miette!("the token cannot be narrowed: {error}"))?;
    match token::claimed(&narrowed) {
        Ok(Identity { roles, .. }) if roles.is_empty() => {
            Err(miette!("the token would be for nothing: it is for other roles"))
        }
        _ => Ok(narrowed),
    }
}
