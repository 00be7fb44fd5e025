// SPDX-License-Identifier: MIT
using System;
using System.Numerics;

namespace SplatBus
{
    /// <summary>
    /// Numbers as JSON spells them, correctly rounded in both directions [ACC-1, ACC-14]. What the
    /// framework has for it is off by an ULP under Mono and in .NET before Core 3.0.
    /// </summary>
    public static class Numbers
    {
        /// <summary>Of any number that is written, in bytes.</summary>
        public const int MaxBytes = 32;

        /// <summary>Digits that can decide how a double is rounded; further ones only break a tie.</summary>
        const int DecidingDigits = 800;

        static readonly ulong[] Fives = PowersOfFive();
        static readonly double[] ExactTens = PowersOfTen();

        /// <summary>The double nearest to a JSON number, ties to even; infinity beyond the range.</summary>
        /// <param name="text">A number by the grammar of RFC 8259, which is not checked here.</param>
        public static double Read(ReadOnlySpan<byte> text)
        {
            int at = 0;
            bool negative = text[0] == '-';
            if (negative) at++;
            ulong digits = 0;
            int count = 0, exponent = 0;
            bool point = false;
            for (; at < text.Length; at++)
            {
                int digit = text[at] - '0';
                if (text[at] == '.') { point = true; continue; }
                if (digit < 0 || digit > 9) break;
                if (count == 0 && digit == 0) { if (point) exponent--; continue; }
                if (count < 19) digits = 10 * digits + (ulong)digit;
                count++;
                if (point) exponent--;
            }
            if (at < text.Length) exponent = Math.Max(-1 << 24, Math.Min(1 << 24, exponent + Exponent(text.Slice(at + 1))));
            double magnitude = count > 19 ? ReadLong(text, count, exponent) : Scaled(digits, exponent);
            return negative ? -magnitude : magnitude;
        }

        /// <summary>A spelling that reads back as the value: the shortest of 15 digits or more.</summary>
        /// <returns>How many bytes of <paramref name="to"/> it takes.</returns>
        /// <exception cref="ArgumentException">The value is not finite [JSN-4].</exception>
        public static int Write(double value, Span<byte> to)
        {
            if (double.IsNaN(value) || double.IsInfinity(value)) throw new ArgumentException("not a finite number [JSN-4]");
            int at = 0;
            long bits = BitConverter.DoubleToInt64Bits(value);
            if (bits < 0) to[at++] = (byte)'-';
            double magnitude = Math.Abs(value);
            if (magnitude == 0) return at + Ascii("0.0", to.Slice(at));
            int top = (int)Math.Floor(Math.Log10(magnitude));
            for (int places = 15; ; places++)
            {
                ulong digits = Digits(bits, places - 1 - top);
                int exponent = top - places + 1;
                if (places >= 17 || Scaled(digits, exponent) == magnitude) return at + Spell(digits, exponent, to.Slice(at));
            }
        }

        /// <summary>An integer in decimal.</summary>
        /// <returns>How many bytes it takes.</returns>
        public static int Write(long value, Span<byte> to)
        {
            int at = 0;
            ulong left = value < 0 ? (ulong)-value : (ulong)value;
            if (value < 0) to[at++] = (byte)'-';
            int end = at + Length(left);
            for (int place = end - 1; place >= at; place--, left /= 10) to[place] = (byte)('0' + left % 10);
            return end;
        }

        static int Exponent(ReadOnlySpan<byte> text)
        {
            int at = text[0] == '-' || text[0] == '+' ? 1 : 0;
            int value = 0;
            for (int i = at; i < text.Length; i++) value = Math.Min(1 << 24, 10 * value + text[i] - '0');
            return text[0] == '-' ? -value : value;
        }

        /// <summary>digits · 10^exponent, rounded once.</summary>
        static double Scaled(ulong digits, int exponent)
        {
            if (digits == 0) return 0;
            if (digits <= 1UL << 53 && exponent >= -22 && exponent <= 22)
                return exponent < 0 ? digits / ExactTens[-exponent] : digits * ExactTens[exponent];
            if (exponent < -27 || exponent > 27) return ScaledExactly(digits, exponent);
            ulong high, low;
            if (exponent >= 0)
            {
                Multiply(digits, Fives[exponent], out high, out low);
                return Rounded(high, low, false, exponent);
            }
            // Both with their top bit set, so that the quotient has 63 bits or 64.
            ulong divisor = Fives[-exponent];
            int up = LeadingZeros(digits), across = LeadingZeros(divisor);
            digits <<= up;
            divisor <<= across;
            bool inexact;
            ulong quotient = Divide(digits >> 1, digits << 63, divisor, out inexact);
            return Rounded(0, quotient, inexact, exponent - up + across - 63);
        }

        /// <summary>As <see cref="Scaled"/>, for any exponent; this allocates.</summary>
        static double ScaledExactly(BigInteger digits, int exponent)
        {
            if (digits.IsZero || exponent < -1200) return 0;
            if (exponent > 400) return double.PositiveInfinity;
            BigInteger over = exponent < 0 ? BigInteger.Pow(10, -exponent) : BigInteger.One;
            if (exponent > 0) digits *= BigInteger.Pow(10, exponent);
            int shift = 8 * (over.ToByteArray().Length - digits.ToByteArray().Length) + 80;
            BigInteger rest, quotient = BigInteger.DivRem(shift < 0 ? digits : digits << shift, shift < 0 ? over << -shift : over, out rest);
            ulong low = (ulong)(quotient & ulong.MaxValue), high = (ulong)(quotient >> 64);
            return Rounded(high, low, !rest.IsZero, -shift);
        }

        static double ReadLong(ReadOnlySpan<byte> text, int count, int exponent)
        {
            BigInteger digits = 0;
            ulong some = 0, scale = 1;
            int taken = 0;
            bool more = false;
            foreach (byte each in text)
            {
                if (each == 'e' || each == 'E') break;
                if (each < '0' || each > '9' || taken == 0 && each == '0') continue;
                if (taken >= DecidingDigits) { more |= each != '0'; continue; }
                some = 10 * some + each - '0';
                scale *= 10;
                taken++;
                if (scale < 1000000000000000000UL && taken < Math.Min(count, DecidingDigits)) continue;
                digits = digits * scale + some;
                some = 0;
                scale = 1;
            }
            if (more) { digits = 10 * digits + 1; taken++; }
            return ScaledExactly(digits, exponent + count - taken);
        }

        /// <summary>(high · 2^64 + low, and a little more if inexact) · 2^exponent, ties to even.</summary>
        static double Rounded(ulong high, ulong low, bool inexact, int exponent)
        {
            int zeros = high != 0 ? LeadingZeros(high) : 64 + LeadingZeros(low);
            int length = 128 - zeros;
            int drop = Math.Max(length - 53, -1074 - exponent);
            if (drop > 127) return drop > length ? 0 : double.Epsilon;
            if (drop <= 0) return Made(low << -drop, exponent + drop);
            ulong kept = drop >= 64 ? (drop == 64 ? high : high >> (drop - 64)) : low >> drop | (drop == 0 ? 0 : high << (64 - drop));
            int below = drop - 1;
            bool half = (below >= 64 ? high >> (below - 64) & 1 : low >> below & 1) != 0;
            bool rest = inexact || (below >= 64 ? low != 0 || (high & ((1UL << (below - 64)) - 1)) != 0 : (low & ((1UL << below) - 1)) != 0);
            if (half && (rest || (kept & 1) != 0)) kept++;
            return Made(kept, exponent + drop);
        }

        /// <summary>significand · 2^exponent, which a double holds or which overflows.</summary>
        static double Made(ulong significand, int exponent)
        {
            if (significand == 0) return 0;
            while (significand < 1UL << 52 && exponent > -1074) { significand <<= 1; exponent--; }
            if (significand == 1UL << 53) { significand >>= 1; exponent++; }
            if (exponent > 971) return double.PositiveInfinity;
            ulong biased = significand < 1UL << 52 ? 0 : (ulong)(exponent + 1075);
            return BitConverter.Int64BitsToDouble((long)(biased << 52 | significand & ((1UL << 52) - 1)));
        }

        /// <summary>A double times 10^power, to the nearest integer.</summary>
        static ulong Digits(long bits, int power)
        {
            int biased = (int)(bits >> 52 & 0x7ff);
            ulong significand = (ulong)bits & ((1UL << 52) - 1);
            if (biased == 0) biased = 1; else significand |= 1UL << 52;
            int exponent = biased - 1075 + power;
            if (power >= 0 && power <= 27 && exponent < 0 && exponent > -128)
            {
                ulong high, low;
                Multiply(significand, Fives[power], out high, out low);
                int right = -exponent - 1;
                ulong doubled = right >= 64 ? high >> (right - 64) : right == 0 ? low : low >> right | high << (64 - right);
                return (doubled >> 1) + (doubled & 1);
            }
            BigInteger number = significand, over = BigInteger.One;
            if (power >= 0) number *= BigInteger.Pow(10, power); else over = BigInteger.Pow(10, -power);
            exponent -= power;
            if (exponent >= 0) number <<= exponent; else over <<= -exponent;
            return (ulong)((2 * number + over) / (2 * over));
        }

        static int Spell(ulong digits, int exponent, Span<byte> to)
        {
            while (digits % 10 == 0) { digits /= 10; exponent++; }
            int length = Length(digits), top = length + exponent - 1, at = 0;
            if (exponent >= 0 && top < 17)
            {
                for (; exponent > 0; exponent--) digits *= 10;
                at = Write((long)digits, to);
                return at + Ascii(".0", to.Slice(at));
            }
            if (top < 0 && top >= -5)
            {
                at = Ascii("0.", to);
                for (int i = -1; i > top; i--) to[at++] = (byte)'0';
                return at + Write((long)digits, to.Slice(at));
            }
            int whole = top >= 0 && top < 17 ? top + 1 : 1;
            Write((long)digits, to.Slice(1));
            to.Slice(1, whole).CopyTo(to);
            at = length;
            if (length > whole) { to[whole] = (byte)'.'; at++; }
            if (whole == top + 1) return at;
            to[at++] = (byte)'e';
            return at + Write((long)top, to.Slice(at));
        }

        static int Length(ulong value)
        {
            int length = 1;
            while ((value /= 10) != 0) length++;
            return length;
        }

        static int Ascii(string text, Span<byte> to)
        {
            for (int i = 0; i < text.Length; i++) to[i] = (byte)text[i];
            return text.Length;
        }

        static int LeadingZeros(ulong value)
        {
            if (value == 0) return 64;
            int zeros = 0;
            for (int step = 32; step > 0; step >>= 1)
                if (value >> (64 - step) == 0) { zeros += step; value <<= step; }
            return zeros;
        }

        static void Multiply(ulong a, ulong b, out ulong high, out ulong low)
        {
            ulong a0 = (uint)a, a1 = a >> 32, b0 = (uint)b, b1 = b >> 32;
            ulong middle = a1 * b0 + (a0 * b0 >> 32);
            ulong other = a0 * b1 + (uint)middle;
            high = a1 * b1 + (middle >> 32) + (other >> 32);
            low = a * b;
        }

        /// <summary>128 bits by 64, of which the top one is set; high is less than the divisor.</summary>
        static ulong Divide(ulong high, ulong low, ulong divisor, out bool inexact)
        {
            ulong quotient = 0;
            for (int i = 0; i < 64; i++)
            {
                bool carry = high >> 63 != 0;
                high = high << 1 | low >> 63;
                low <<= 1;
                quotient <<= 1;
                if (carry || high >= divisor) { high -= divisor; quotient |= 1; }
            }
            inexact = high != 0;
            return quotient;
        }

        static ulong[] PowersOfFive()
        {
            var powers = new ulong[28];
            powers[0] = 1;
            for (int i = 1; i < powers.Length; i++) powers[i] = 5 * powers[i - 1];
            return powers;
        }

        static double[] PowersOfTen()
        {
            var powers = new double[23];
            powers[0] = 1;
            for (int i = 1; i < powers.Length; i++) powers[i] = 10 * powers[i - 1];
            return powers;
        }
    }
}
