"""What files say of a robot: links, joints, shapes; read, checked, and told to other machines."""
