module slideshow

go 1.19
