"""Where the vehicle is: inertial navigation, corrected by compass, altimeter and flow."""
