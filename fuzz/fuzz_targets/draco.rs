#![no_main]

kdray_fuzz::target!(Draco);
