"""Human bodies by the thousand, made on the user's machine from the body model `anny`."""
