//! The registry: a macro that makes the enum of all kinds, with inlined dispatch, from one line a kind.
//!
//! An enum and not `dyn Effect`, so that the hot path stays one function that run-time chosen instruction sets reach.

/// `module => Type,` a line, of modules declared beside it; the module's name is the kind's name in parameter files.
macro_rules! kinds {
    ($($module:ident => $kind:ident,)+) => {
        /// An effect of any kind of the registry.
        #[derive(Clone, Debug)]
        #[allow(missing_docs)]
        pub enum Kind<T> {
            $($kind($module::$kind<T>),)+
        }

        /// What the registry knows of a kind.
        #[derive(Clone, Copy, Debug)]
        pub struct KindInfo {
            /// Its name.
            pub name: &'static str,
            /// One line that says what it is.
            pub summary: &'static str,
            /// Where it may act.
            pub places: &'static [PlaceKind],
            /// Its numbers.
            pub parameters: &'static [Parameter],
            /// Whether several in the same place make sense.
            pub several: bool,
            /// Whether it is observable only where poses of heads are measured.
            pub needs_poses: bool,
            /// Whether it acts by changing the arm's parameters.
            pub changes_arm: bool,
            pub(crate) objection: fn(&[f64], &Definition, &Body<f64>) -> Option<String>,
        }

        /// All kinds, in the order of the registry.
        pub static KINDS: &[KindInfo] = &[$({
            type K = $module::$kind<f64>;
            KindInfo {
                name: stringify!($module),
                summary: <K as Effect<f64>>::SUMMARY,
                places: <K as Effect<f64>>::PLACES,
                parameters: <K as Effect<f64>>::PARAMETERS,
                several: <K as Effect<f64>>::SEVERAL,
                needs_poses: <K as Effect<f64>>::NEEDS_POSES,
                changes_arm: <K as Effect<f64>>::CHANGES_ARM,
                objection: <K as Effect<f64>>::objection,
            }
        }),+];

        impl<T: Real> Kind<T> {
            /// The effect of kind number `index` of [`KINDS`].
            pub fn new(index: usize, definition: &Definition, values: &[T]) -> Self {
                let makers: &[fn(&Definition, &[T]) -> Self] =
                    &[$(|d, v| Self::$kind(<$module::$kind<T> as Effect<T>>::new(d, v))),+];
                makers[index](definition, values)
            }
        }

        $crate::effects::registry::dispatch! { $($kind)+ }
    };
}

/// The hooks of [`super::Effect`] on the enum.
macro_rules! dispatch {
    ($($kind:ident)+) => {
        $crate::effects::registry::hooks! {
            ($($kind)+)
            change_arm(body: &mut Body<T>);
            is_actuation() -> bool;
            hidden() -> usize;
            start(hidden: &mut [T]);
            moved(moved: &[T], hidden: &mut [T]);
            add_forces(now: &mut Instant<'_, T>, hidden: &[T]);
            advance(now: &Instant<'_, T>, hidden: &mut [T]);
            shapes_pressures() -> bool;
            remembers() -> bool;
            pressures(elapsed: T, from: &[T], last: &[T], p: &mut [T]);
            pressures_at_rest(p: &mut [T]);
            moved_pressures(moved: &[T], by: &mut [T]);
            input_delay(input: usize) -> Option<T>;
            sensor_delay(coordinate: usize) -> Option<T>;
            head_delay(section: usize) -> Option<T>;
            play(coordinate: usize) -> Option<T>;
            shapes_heads() -> bool;
            see(section: usize, head: &mut Pose<T>);
            shapes_lengths() -> bool;
            measure(coordinate: usize, length: T) -> T;
            twist(section: usize, torque: T, stretch: T) -> Option<T>;
        }
    };
}

/// One method that matches on the kind, a hook.
macro_rules! hooks {
    ($kinds:tt $($name:ident($($arg:ident: $type:ty),*) $(-> $out:ty)?;)+) => {
        impl<T: Real> Kind<T> {
            $($crate::effects::registry::hook! { $kinds $name($($arg: $type),*) $(-> $out)? })+
        }
    };
}

/// See [`super::Effect`].
macro_rules! hook {
    (($($kind:ident)+) $name:ident $args:tt $(-> $out:ty)?) => {
        $crate::effects::registry::hook! { @ [$($kind)+] $name $args ($($out)?) }
    };
    (@ [$($kind:ident)+] $name:ident ($($arg:ident: $type:ty),*) ()) => {
        $crate::effects::registry::hook! { # [$($kind)+] $name [$($arg: $type),*] [$($arg),*] () }
    };
    (@ [$($kind:ident)+] $name:ident ($($arg:ident: $type:ty),*) ($out:ty)) => {
        $crate::effects::registry::hook! { # [$($kind)+] $name [$($arg: $type),*] [$($arg),*] ($out) }
    };
    (# [$($kind:ident)+] $name:ident [$($arg:ident: $type:ty),*] $pass:tt ($($out:ty)?)) => {
        #[doc = concat!("See [`Effect::", stringify!($name), "`].")]
        #[inline(always)]
        pub fn $name(&self, $($arg: $type),*) $(-> $out)? {
            match self {
                $(Self::$kind(e) => $crate::effects::registry::call!(e $name $pass),)+
            }
        }
    };
}

/// `e.name(args)`.
macro_rules! call {
    ($e:ident $name:ident [$($arg:ident),*]) => { Effect::$name($e, $($arg),*) };
}

pub(super) use {call, dispatch, hook, hooks, kinds};
